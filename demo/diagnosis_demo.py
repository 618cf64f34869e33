# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Demonstration of the loop with a hidden effect: python demo/diagnosis_demo.py.

The simulated robot gets a random effect that its model lacks, and two recordings are made. The
`pprs` commands report where the model fails and why, and add the missing effect, so that the error
falls; or they report that several effects are possible. The hidden effect is in a file that is
opened at the end. Every command is printed, to be repeated by hand.
"""

from __future__ import annotations

import argparse
import json
import os
import secrets
import shlex
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from before_after import draw_before_after
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from ros_processes import executable

from pprs_dynamics.inference.diagnosis.quantities import with_uncertainty
from pprs_dynamics.inference.residuals.measuring import measure_residuals
from pprs_dynamics.measurement.files.recording import read_recording
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.model.drive_model import DriveModel

REFUSED = 1  # exit status of pprs
SEEDS = 10_000


class Story:
    """Says what is done, does it, and stops where a command fails.

    Parameters
    ----------
    console : rich.console.Console
    folder : Path
        For all that is written.
    """

    def __init__(self, console: Console, folder: Path) -> None:
        self.console, self.folder = console, folder
        self.chapters = 0

    def chapter(self, title: str) -> None:
        """Begin a chapter."""
        self.chapters += 1
        self.console.print()
        self.console.rule(f'[bold]{self.chapters}. {title}[/]', align='left')

    def say(self, text: str) -> None:
        """Print a sentence."""
        self.console.print(text, highlight=False)

    def file(self, name: str) -> str:
        """Return the path of a file of this story."""
        return str(self.folder / name)

    def read(self, name: str) -> dict[str, Any]:
        """Return what a command wrote with --json."""
        content: dict[str, Any] = json.loads((self.folder / name).read_text())
        return content

    def start(self, *arguments: str, quiet: bool = False) -> subprocess.Popen[str]:
        """Print a command of `pprs`, and start it."""
        self.console.print(f'[bold cyan]$ {escape(" ".join(("pprs", *arguments)))}[/]',
                           highlight=False, soft_wrap=True)
        width = os.environ.get('COLUMNS', str(self.console.width))
        return subprocess.Popen(
            [executable('pprs'), *arguments], text=True, env={**os.environ, 'COLUMNS': width},
            stdout=subprocess.PIPE if quiet else None)

    def run(self, *arguments: str, accepted: Sequence[int] = (0,)) -> int:
        """Run a command of `pprs` to its end; one that fails ends the story."""
        return self.end(self.start(*arguments), accepted)

    def end(self, process: subprocess.Popen[str], accepted: Sequence[int] = (0,)) -> int:
        """Wait for a command."""
        text, _ = process.communicate()
        if text:
            self.console.print(text.strip(), markup=False, highlight=False)
        if process.returncode not in accepted:
            raise SystemExit(f'a command ended with status {process.returncode}: see above')
        return process.returncode


def main() -> int:
    """Run all chapters and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else '')
    parser.add_argument('output', nargs='?', default='output', help='folder (default output)')
    parser.add_argument('--seed', type=int, default=None, help='draws the effect; repeats a run')
    parser.add_argument('--effect', default='random', help='what is hidden (default: drawn)')
    parser.add_argument('--duration', type=float, default=20.0, help='of a recording [s]')
    options = parser.parse_args()
    seed = secrets.randbelow(SEEDS) if options.seed is None else options.seed
    console = Console()
    if not console.is_terminal and 'COLUMNS' not in os.environ:
        console = Console(width=100)
    folder = Path(options.output)
    folder.mkdir(parents=True, exist_ok=True)
    story, began = Story(console, folder), time.monotonic()
    for name in ('run.mcap', 'other.mcap', 'adopted.yaml', 'demo.png'):
        with suppress(FileNotFoundError):
            (folder / name).unlink()
    record(story, options.effect, seed, options.duration)
    compare(story)
    diagnosis = diagnose(story)
    added = adopt(story, diagnosis)
    sentence = reveal(story, diagnosis, added)
    picture = draw(story, added, sentence)
    story.say(f'\nPicture: [b]{picture}[/]   pages: [b]{story.file("before.html")}[/], '
              f'[b]{story.file("why.html")}[/]'
              + (f', [b]{story.file("after.html")}[/]' if added else ''))
    story.say('Try it out, effect by effect, in the browser:')
    console.print(f'[bold cyan]$ {escape(workbench_command(story))}[/]', highlight=False,
                  soft_wrap=True)
    story.say(f'[dim]{time.monotonic() - began:.0f} s; the same again with --seed {seed}[/]')
    return 0


def workbench_command(story: Story) -> str:
    """Return the command that opens the two recordings in the workbench."""
    return shlex.join((executable('pprs'), 'workbench', story.file('run.mcap'), '--validate',
                       story.file('other.mcap'), '--demo'))


def record(story: Story, effect: str, seed: int, duration: float) -> None:
    """Record two motions of a robot with a hidden effect; what it is, nobody here knows."""
    story.chapter('A robot with a secret')
    story.say('A physics engine simulates the robot. It draws one hidden effect: one of the '
              f'{len(CATALOGUE)} of the catalogue, or one of a few others. The effect is written '
              f'to {story.file("truth.json")}, which is read only at the end.')
    # The folder is the demonstration's own, which may run again.
    for name in ('run.mcap', 'other.mcap'):
        (story.folder / name).unlink(missing_ok=True)
    common = ('--effect', effect, '--seed', str(seed), '--duration', f'{duration:g}', '--demo')
    first = story.start('simulate', '--output', story.file('run.mcap'), *common,
                        '--json', story.file('truth.json'))
    # Beside the first, as there are two cores; its bar would write over the first one's.
    second = story.start('simulate', '--output', story.file('other.mcap'), *common,
                         '--path-seed', '1', quiet=True)
    story.end(first)
    story.end(second)
    story.say('other.mcap is another motion of the same robot. It is not fitted: the held-out '
              'errors are measured on it.')


def compare(story: Story) -> None:
    """Say how wrong the model is, and where."""
    story.chapter('How wrong is the model, and where?')
    story.run('compare', story.file('run.mcap'), '--report', story.file('before.html'),
              '--json', story.file('before.json'), '--demo')


def diagnose(story: Story) -> dict[str, Any]:
    """Say why, and return what was said."""
    story.chapter('Why?')
    story.run('diagnose', story.file('run.mcap'), '--validate', story.file('other.mcap'),
              '--report', story.file('why.html'), '--json', story.file('why.json'), '--demo')
    diagnosis = story.read('why.json')
    for names in diagnosis['indistinguishable']:
        story.say(f'[yellow]This motion does not separate {" and ".join(names)}.[/] The first is '
                  'tried; the motion that was not fitted judges it.')
    if diagnosis['verdict'] == 'unknown':
        story.say('[yellow]Something remains that no effect of the catalogue explains.[/] It is '
                  'not forced into one.')
    return diagnosis


def adopt(story: Story, diagnosis: dict[str, Any]) -> bool:
    """Add the reported effects, and compare again; False for none, and where they are refused."""
    story.chapter('Add it, and compare again')
    names = [effect['name'] for effect in diagnosis['effects']]
    if not names:
        story.say('There is nothing to add: ' + (
            'the model is adequate for this recording.'
            if diagnosis['verdict'] == 'adequate' else
            'no effect of the catalogue has the form of this error. The model is unchanged.'))
        return False
    data = (story.file('run.mcap'), '--validate', story.file('other.mcap'),
            '--output', story.file('adopted.yaml'), '--demo')
    if len(names) == 1:
        status = story.run('adopt', names[0], *data, accepted=(0, REFUSED))
    else:
        status = story.run('diagnose', *data, '--adopt-all', accepted=(0, REFUSED))
    if status == REFUSED:
        story.say('[yellow]Refused[/], with the reason above.')
    if not (story.folder / 'adopted.yaml').exists():
        story.say('The model is unchanged.')
        return False
    model = ('--model', story.file('adopted.yaml'))
    story.run('compare', story.file('run.mcap'), *model, '--report', story.file('after.html'),
              '--json', story.file('after.json'))
    story.run('history', story.file('adopted.yaml'))
    return True


def reveal(story: Story, diagnosis: dict[str, Any], added: bool) -> str:
    """Open the file with the truth, and return how the diagnosis did, in a sentence."""
    story.chapter('What was hidden')
    hidden, = story.read('truth.json')['effects']
    table = Table(show_header=True, title_justify='left', title=hidden['name'],
                  title_style='bold')
    table.add_column('')
    table.add_column('hidden in the robot', style='green')
    table.add_column('found from the recording', style='cyan')
    found = diagnosis['effects']
    table.add_row('effect', hidden['name'], ', '.join(e['name'] for e in found) or 'nothing')
    table.add_row('on', _drives(hidden), '; '.join(_drives(effect) for effect in found) or '-')
    table.add_row('parameters', _hidden_parameters(hidden['parameters']),
                  '\n'.join(f'{key} = {with_uncertainty(p["value"], p["std"] or 0.0, p["unit"])}'
                            for effect in found
                            for key, p in effect['parameters'].items() if p['value']) or '-')
    story.console.print(table)
    sentence = _judged(hidden, diagnosis)
    if not added:
        sentence += ' Nothing was added to the model.'
    story.say(f'[bold]{escape(sentence)}[/]')
    return sentence


def draw(story: Story, added: bool, sentence: str) -> Path:
    """Draw what it has brought on the motion that was not fitted, and say it."""
    recording = read_recording(story.file('other.mcap'))
    before, _ = measure_residuals(DriveModel.load(), [recording])
    after = None
    noise = float(story.read('why.json')['noise_floor'])
    if added:
        after, _ = measure_residuals(DriveModel.load(story.file('adopted.yaml')), [recording])
        fall = [float((residuals.error ** 2).mean() ** 0.5) for residuals in (before, after)]
        sentence += (f'\nError on a motion that was not fitted: {fall[0]:.3f} N before, '
                     f'{fall[1]:.3f} N after.')
    return draw_before_after(story.folder / 'demo.png', before, after, noise, sentence)


def _judged(hidden: dict[str, Any], diagnosis: dict[str, Any]) -> str:
    name, known = hidden['name'], hidden['name'] in CATALOGUE
    found = [effect['name'] for effect in diagnosis['effects']]
    rivals = {rival for names in diagnosis['indistinguishable'] for rival in names}
    others = [other for other in found if other != name]
    if name in found:
        mine = diagnosis['effects'][found.index(name)]
        return f'{name} was hidden, and {name} was found' + (
            f', but on {_drives(mine)} instead of {_drives(hidden)}'
            if set(mine['drives'] or ()) != set(hidden['drives'] or ()) else '') + (
            f'; {", ".join(others)} in addition is not in the robot' if others else '') + (
            '; that something unknown remains is wrong'
            if diagnosis['verdict'] == 'unknown' else '') + '.'
    if name in rivals:
        return f'{name} was hidden; it is among those that this motion does not separate.'
    if not known and diagnosis['verdict'] == 'unknown':
        return (f'{name} was hidden, which no catalogue has, and unknown was the answer'
                + (f'; {", ".join(found)}, which was added, is not in the robot.' if found
                   else '.'))
    if not found:
        suspected = name in [effect['name'] for effect in diagnosis['suspects']]
        return (f'{name} was hidden, and ' + ('was suspected only: slow noise could be it.'
                if suspected else 'was not found: too weak for this motion and noise.'
                if diagnosis['verdict'] == 'adequate' else
                'the answer was that something unknown remains.'))
    return f'{name} was hidden, but {", ".join(found)} was named: that is wrong.'


def _drives(effect: dict[str, Any]) -> str:
    drives = effect['drives']
    return ', '.join(drives) if drives else 'platform and structure'


def _hidden_parameters(parameters: dict[str, Any]) -> str:
    lines = []
    for key, value in parameters.items():
        if isinstance(value, dict):
            lines += [f'{key}.{name} = {number:.4g}' for name, number in value.items()]
        else:
            lines.append(f'{key} = {value:.4g}')
    return '\n'.join(lines)


if __name__ == '__main__':
    sys.exit(main())
