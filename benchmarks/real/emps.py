# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Results on EMPS, a real prismatic drive: python -m benchmarks.real.emps (minutes).

Its authors published the data, a model, and what the model lacks. Their procedure is repeated, and
`pprs` diagnoses the same files. The data is not part of the package.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import butter, decimate, filtfilt

from benchmarks.real.emps_files import IDENTIFICATION, PULSES, read_emps
from benchmarks.real.recorded_data import need_data
from benchmarks.results import ROOT, write_results
from pprs_dynamics import DriveModel, JointMotion, PprsError
from pprs_dynamics.inference.adoption.adopt import AdoptionRun, adopt, adopt_all
from pprs_dynamics.inference.adoption.adoption import Adoption
from pprs_dynamics.inference.adoption.request import EffectRequest
from pprs_dynamics.inference.diagnosis.diagnose import diagnose
from pprs_dynamics.inference.diagnosis.diagnosis import Diagnosis
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.measurement.files.recording import Recording

DOCS = ROOT / 'docs'
# The authors' recipe: Butterworth of order 4 at 100 Hz to and fro, central differences, every tenth
# sample after a filter. The edges, where filters see only one side, are cut by us.
CUT_OFF, ORDER, DECIMATION, EDGE = 100.0, 4, 10, 100
PUBLISHED = {'M': 95.109, 'F_v': 203.50, 'F_c': 20.394, 'offset': -3.165}
PUBLISHED_ERRORS = (4.08, 5.98)  # [%]
PUBLISHED_ASYMMETRIC, PUBLISHED_WITH_BOTH = {'F_v+': 166.7, 'F_v-': 240.4}, 3.11
UNITS = {'M': 'kg', 'F_v': 'N s/m', 'F_c': 'N', 'offset': 'N'}


def published_motion(recording: Recording) -> JointMotion:
    """Return the motion as the authors derive it from the measured positions."""
    step = float(np.median(np.diff(recording.time)))
    q = filtfilt(*butter(ORDER, CUT_OFF * 2 * step), recording.position[:, 0])
    q_dot = np.gradient(q, step)
    return JointMotion(q[:, None], q_dot[:, None], np.gradient(q_dot, step)[:, None],
                       recording.time)


def thinned(values: np.ndarray) -> np.ndarray:
    """Return every tenth sample of (N,) or (N, k) values without the edges, filtered before."""
    return decimate(values[EDGE:-EDGE], DECIMATION, zero_phase=True, axis=0)


def published_columns(recording: Recording, asymmetric: bool = False) -> np.ndarray:
    """Return the columns of M, F_v (or F_v+, F_v-), F_c and the offset, (n, k)."""
    motion = published_motion(recording)
    v = motion.velocity[:, 0]
    viscous = [np.maximum(v, 0), np.minimum(v, 0)] if asymmetric else [v]
    return thinned(np.column_stack(
        [motion.acceleration[:, 0], *viscous, np.sign(v), np.ones_like(v)]))


def fit_published(recording: Recording, asymmetric: bool = False) -> np.ndarray:
    """Return the parameters by least squares."""
    columns = published_columns(recording, asymmetric)
    found: np.ndarray = np.linalg.lstsq(columns, thinned(recording.effort[:, 0]), rcond=None)[0]
    return found


def published_error(recording: Recording, parameters: np.ndarray) -> float:
    """Return the relative error of parameters by the authors' recipe [%]."""
    columns = published_columns(recording, len(parameters) == 5)
    return relative(thinned(recording.effort[:, 0]) - columns @ parameters,
                    thinned(recording.effort[:, 0]))


def error_of(model: DriveModel, recording: Recording) -> float:
    """Return the relative error of a model by the authors' recipe [%]."""
    forces = model.measured(model.drive_forces(published_motion(recording)))
    measured = thinned(recording.effort[:, 0])
    return relative(measured - thinned(forces.total[:, 0]), measured)


def compared(model: DriveModel, recording: Recording) -> float:
    """Return the relative error of `pprs compare` [%]."""
    residuals, _ = measure_residuals(model, [recording])
    seen = np.isfinite(residuals.error[:, 0])  # not before a delay has passed
    measured = residuals.measured[seen, 0]
    return relative(residuals.error[seen, 0], measured - measured.mean())


def relative(error: np.ndarray, measured: np.ndarray) -> float:
    """Return the error over the force, both rms [%]."""
    return 100 * float(np.linalg.norm(error) / np.linalg.norm(measured))


@dataclass(frozen=True)
class Story:
    """All results of the page."""

    run: Recording
    pulses: Recording
    model: DriveModel
    diagnosis: Diagnosis
    asymmetric: Adoption
    ripple: Adoption | None
    blind: AdoptionRun
    gated: AdoptionRun


def tell(run: Recording, pulses: Recording, report: Callable[[str], None]) -> Story:
    """Run everything; the pulses run gates the second loop and the ripple, and nothing else."""
    model = DriveModel.load('config/single_axis.yaml')
    report('diagnosing')
    diagnosis = diagnose(model, [run])
    report('adopting asymmetric_friction')
    asymmetric = adopt(model, EffectRequest.of('asymmetric_friction', model), [run], force=True,
                       diagnosis=diagnosis)
    report('the whole loop, gated by blocks')
    blind = adopt_all(model, [run], diagnosis=diagnosis)
    report('the whole loop, gated by the pulses run')
    gated = adopt_all(model, [run], [pulses], diagnosis=diagnosis)
    report('offering a screw ripple')
    try:
        ripple = adopt(gated.model, EffectRequest.of('force_ripple', gated.model), [run], [pulses])
    except PprsError as error:
        report(str(error))
        ripple = None
    return Story(run, pulses, model, diagnosis, asymmetric, ripple, blind, gated)


def document(story: Story) -> str:
    """Return the tables of results in Markdown."""
    run, pulses = story.run, story.pulses
    found, wide = fit_published(run), fit_published(run, asymmetric=True)
    lines = ['## The published procedure', '',
             '| | published | here | difference |', '|---|---|---|---|']
    for (name, value), ours in zip(PUBLISHED.items(), found, strict=True):
        lines.append(f'| {name} [{UNITS[name]}] | {value} | {ours:.5g} | '
                     f'{100 * (ours / value - 1):+.2f} % |')
    for what, value, recording in zip(('identification', 'pulses'), PUBLISHED_ERRORS, (run, pulses),
                                      strict=True):
        ours = published_error(recording, found)
        lines.append(f'| relative error, {what} run | {value} % | {ours:.2f} % | '
                     f'{ours - value:+.2f} |')
    for (name, value), ours in zip(PUBLISHED_ASYMMETRIC.items(), wide[1:3], strict=True):
        lines.append(f'| {name} [N s/m] | {value} | {ours:.4g} | '
                     f'{100 * (ours / value - 1):+.1f} % |')
    with_both = [published_error(recording, wide) for recording in (run, pulses)]
    lines += [f'| relative error with both, identification run | {PUBLISHED_WITH_BOTH} % | '
              f'{with_both[0]:.2f} % | {with_both[0] - PUBLISHED_WITH_BOTH:+.2f} |',
              f'| relative error with both, pulses run | | {with_both[1]:.2f} % | |',
              '', '## What `pprs diagnose` names', '',
              '| candidate for the first place | evidence | error after [N] |', '|---|---|---|']
    lines += [f'| {candidate.name} | {candidate.evidence:.0f} | {candidate.error_after:.3f} |'
              for candidate in story.diagnosis.candidates]
    lines += ['', f'Verdict on the published model: {story.diagnosis.verdict}; '
              f'{", ".join(effect.name for effect in story.diagnosis.effects) or "no effect"}.', '',
              '## Error along the loop', '',
              "By the authors' recipe, and as `pprs compare` reports it.", '',
              '| model | identification | pulses | `compare`, identification | `compare`, pulses |',
              '|---|---|---|---|---|']
    rows: list[tuple[str, DriveModel]] = [
        ('published, symmetric friction', story.model),
        ('with asymmetric_friction', story.asymmetric.after)]
    for outcome, name in ((story.blind, 'blocks'), (story.gated, 'pulses run')):
        rows += [(f'gated by {name}: + {step.effect}', step.after) for step in outcome.adopted]
    for name, model in rows:
        figures = [f(model, recording) for f in (error_of, compared) for recording in (run, pulses)]
        lines.append(f'| {name} | ' + ' | '.join(f'{figure:.2f} %' for figure in figures) + ' |')
    lines += ['', *_ending('blocks of the identification run', story.blind),
              *_ending('the pulses run', story.gated)]
    if story.ripple is not None:
        lines.append(f'- A force_ripple asked for in the last model: '
                     f'{"taken" if story.ripple.adopted else "refused"}: {story.ripple.reason}.')
    return '\n'.join(lines)


def _ending(name: str, outcome: AdoptionRun) -> list[str]:
    steps = ', '.join(step.effect for step in outcome.adopted) or 'nothing'
    return [f'- Gated by {name}: adopted {steps}; ended {outcome.ended}.',
            *(f'  - {reason}.' for reason in outcome.reason.split('; '))]


def draw(story: Story, path: Path) -> None:
    """Draw the error over velocity and over time, before and after."""
    from matplotlib.figure import Figure  # tests import the rest of this file

    figure = Figure(figsize=(10, 7), layout='constrained')
    axes = figure.subplots(2, 1)
    models = {'published': story.model, 'with asymmetric_friction': story.asymmetric.after,
              'after the loop': story.gated.model}
    for (name, model), colour in zip(models.items(), ('#999999', '#0072B2', '#D55E00'),
                                     strict=True):
        residuals, _ = measure_residuals(model, [story.run])
        v = 1e3 * residuals.variables['velocity'][:, 0]
        axes[0].plot(v, residuals.error[:, 0], '.', ms=2, color=colour, label=name)
        shown = residuals.time < 6.3
        axes[1].plot(residuals.time[shown], residuals.error[shown, 0], color=colour, lw=1)
    axes[0].set(xlabel='velocity [mm/s]', ylabel='measured minus model [N]',
                title='EMPS, identification run')
    axes[1].set(xlabel='time [s], one of four periods', ylabel='measured minus model [N]')
    axes[0].legend(markerscale=5, frameon=False)
    for axis in axes:
        axis.grid(alpha=0.25)
        axis.spines[['top', 'right']].set_visible(False)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Write the results and their picture; `docs/real_drive.py` copies the errors to the page."""
    folder = need_data('emps', IDENTIFICATION)
    story = tell(read_emps(folder / IDENTIFICATION), read_emps(folder / PULSES), print)
    draw(story, DOCS / 'images' / 'real_drive.png')
    write_results('emps', 'A real drive: EMPS', 'python -m benchmarks.real.emps', document(story))


if __name__ == '__main__':
    main()
