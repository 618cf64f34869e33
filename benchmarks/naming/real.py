# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Problems of real machines, of which somebody knows what the model lacks.

    python -m benchmarks.naming.real FOLDER

Recordings whose licence allows it lie in `recordings`; `benchmarks.naming.fetch` gets others from
their source, and what is then not in ../shared/data or below PPRS_DATA is passed over. What is
known: the authors' finding (EMPS), a weight that was put on (UR10e, da Vinci, pendulum), that
efforts are the controller's own command (pendulum) or late (iiwa), or that a number of a fitted
model was set to 0. Base models come from `pprs fit`, on runs without the weight. FOLDER is entered
and scored like any other.
"""

from __future__ import annotations

import argparse
import contextlib
import gzip
import json
import shutil
import sys
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from benchmarks import ROOT
from benchmarks.naming.columns import problem_of
from benchmarks.naming.problems import Named, Truth
from benchmarks.real import davinci, emps_files, recorded_data, ur10e
from pprs_dynamics.app.commands.pprs import main as pprs
from pprs_dynamics.measurement.files.recording import read_recording, write_recording
from pprs_dynamics.physics.model.drive_model import DriveModel
from pprs_dynamics.physics.model.model_writer import write_model

UR10E_FREE = tuple(f'{name}.csv.gz' for name in ur10e.FITTED)
UR10E_JOINTS = ('shoulder_lift_joint', 'elbow_joint', 'wrist_2_joint')
RECORDINGS = Path(__file__).parent / 'recordings'  # that are shipped


@dataclass(frozen=True)
class Part:
    """One recording of a real machine.

    Parameters
    ----------
    machine : str
    folder : str
        Of its files, below one of those of `_data`.
    recording : str
    effect : str
        What the model lacks; '' for efforts that are no measurement.
    drives : tuple of str, optional
    model : str or callable
        The model file, or what writes it into a folder.
    fitted : tuple of str
        Recordings that the base model is fitted to; by default it is not fitted.
    adopted : bool
        Whether the base model gets what `--adopt-all` finds on them.
    zero : str
        Number of the base model that is set to 0 on the drive: what is then missing.
    """

    machine: str
    folder: str
    recording: str
    effect: str
    drives: tuple[str, ...] | None
    model: str | Callable[[Path], str]
    fitted: tuple[str, ...] = ()
    adopted: bool = False
    zero: str = ''

    @property
    def name(self) -> str:
        """Of the problem: says nothing about what is missing."""
        what = repr((self.recording, self.effect, self.drives, self.zero))
        return f'{self.machine}_{zlib.crc32(what.encode()):08x}'


def _written(name: str, text: Callable[[], str]) -> Callable[[Path], str]:
    def write(folder: Path) -> str:
        (folder / name).write_text(text())
        return name
    return write


def _without(machine: str, folder: str, recording: str, model: str | Callable[[Path], str],
             drives: tuple[str, ...], kind: str, fitted: tuple[str, ...] = ()) -> tuple[Part, ...]:
    return tuple(Part(machine, folder, recording, f'{kind}_friction', (drive,), model, fitted,
                      zero=f'friction.{kind}') for drive in drives)


UR10E, PSM = _written('arm.yaml', lambda: ur10e.MODEL), _written('psm.yaml', davinci.model_text)
PARTS = (
    *(Part('emps', 'emps', name, 'asymmetric_friction', ('axis',),
           str(ROOT / 'config' / 'single_axis.yaml')) for name in (emps_files.IDENTIFICATION,
                                                                   emps_files.PULSES)),
    Part('ur10e', 'ur10e', f'{ur10e.LOADED}.csv.gz', 'payload_mass', None, UR10E, UR10E_FREE),
    *_without('ur10e', 'ur10e', f'{ur10e.HELD_OUT}.csv.gz', UR10E, UR10E_JOINTS, 'coulomb',
              UR10E_FREE),
    *_without('ur10e', 'ur10e', f'{ur10e.HELD_OUT}.csv.gz', UR10E, UR10E_JOINTS[:2], 'viscous',
              UR10E_FREE),
    *(Part('psm', 'dvrk', f'{name}.csv.gz', 'link_mass', None, PSM, (davinci.FREE,), True)
      for name in davinci.LOADED),
    Part('pendulum', 'pendulum', 'kg.csv.gz', 'payload_mass', None, 'pendulum.yaml',
         ('free.csv.gz',)),
    Part('pendulum', 'pendulum', 'gc.csv.gz', '', None, 'pendulum.yaml'),
    Part('iiwa', 'iiwa', 'j4_1_half.csv.gz', 'time_delay', ('j4',), 'j4.yaml',
         ('j4_1_half.csv.gz',)),
    *_without('kr300', 'kr300', 'A.csv.gz', 'kr.yaml', ('a2', 'a3'), 'viscous', ('A.csv.gz',)),
    *_without('schunk', 'schunk', 'm100.csv.gz', 'lwa.yaml', ('a2', 'a4'), 'viscous'),
)


def _data(part: Part) -> Path | None:
    """Return the folder with a part's files, None where there is none."""
    shipped = RECORDINGS / part.folder
    return (shipped if (shipped / part.recording).is_file()
            else recorded_data.find_data(part.folder, part.recording))


def _base(part: Part, data: Path, folder: Path) -> Path:
    """Return the base model of a part, from the folder where it was made before."""
    folder.mkdir(parents=True, exist_ok=True)
    # What is named by its whole path is ours, what is not lies beside the recording.
    model = data / part.model if isinstance(part.model, str) else folder / part.model(folder)
    for file in {*data.glob('*.urdf'), *model.parent.glob(f'{model.stem}.urdf'), model,
                 *(data / name for name in part.fitted)}:
        if not (folder / file.name).exists():
            shutil.copy(file, folder)
    model = folder / model.name
    if not part.fitted:
        return model
    base, full = folder / f'{model.stem}_base.yaml', folder / f'{model.stem}_full.yaml'
    with contextlib.chdir(folder):
        if not base.exists():
            # The pendulum's torque looks like no measurement, which ends a fit.
            pprs(['fit', *part.fitted, '--model', model.name, '--output', base.name,
                  '--as-it-is'])
        if part.adopted and not full.exists():
            pprs(['diagnose', *part.fitted, '--model', base.name, '--adopt-all', '--output',
                  full.name])
    return full if part.adopted else base


def make(part: Part, data: Path, folder: Path) -> None:
    """Write a problem and its truth."""
    base = _base(part, data, folder / 'bases' / part.folder)
    target = folder / 'problems' / part.name
    target.mkdir(parents=True, exist_ok=True)
    values = dict(DriveModel.load(base).values)
    if part.zero:
        assert part.drives
        numbers = list(values[part.zero])
        numbers[DriveModel.load(base).drives.index(part.drives[0])] = 0.0
        values[part.zero] = tuple(numbers)
    write_model(target / 'model.yaml', values, base)
    for urdf in base.parent.glob('*.urdf'):
        shutil.copy(urdf, target)
    if part.recording.endswith('.mat'):
        write_recording(target / 'recording.csv', emps_files.read_emps(data / part.recording))
    else:
        (target / 'recording.csv').write_bytes(
            gzip.decompress((data / part.recording).read_bytes()))
    model = DriveModel.load(target / 'model.yaml')
    problem_of(model, read_recording(target / 'recording.csv', model.recorded)).write(target)
    truth = Truth(part.name, part.machine, 'single' if part.effect else 'unknown', 'real', 0.0,
                  (Named(part.effect or 'command', part.drives),))
    (folder / 'truth').mkdir(exist_ok=True)
    (folder / 'truth' / f'{part.name}.json').write_text(json.dumps(truth.to_dict(), indent=1))


def main() -> int:
    """Make the problems whose recordings are there and that were not made yet."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('folder', type=Path)
    folder = parser.parse_args().folder.resolve()
    for part in PARTS:
        data = _data(part)
        if data is None:
            print(f'{part.name}: {recorded_data.missing(part.folder)}; '
                  'python -m benchmarks.naming.fetch gets what its source offers')
        elif not (folder / 'truth' / f'{part.name}.json').exists():
            print(part.name, flush=True)
            make(part, data, folder)
    return 0


if __name__ == '__main__':
    sys.exit(main())
