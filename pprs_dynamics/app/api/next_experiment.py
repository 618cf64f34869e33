# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Design of the motion that best separates the remaining candidates."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from pprs_dynamics.app.api.inputs import Inputs, Model, Progress, Recordings, stage
from pprs_dynamics.app.api.result import Result
from pprs_dynamics.app.report import charts
from pprs_dynamics.app.report.page import Page
from pprs_dynamics.app.report.pictures import plot_over_time
from pprs_dynamics.app.report.terminal import PlainTable, escape, stacked, titled_table
from pprs_dynamics.arrays import Array
from pprs_dynamics.drives import common_unit
from pprs_dynamics.inference.experiments.next_experiment import Experiment
from pprs_dynamics.inference.experiments.next_experiment import next_experiment as design
from pprs_dynamics.physics.mechanism.joint_motion import JointMotion
from pprs_dynamics.physics.mechanism.motion import PlatformMotion
from pprs_dynamics.simulation.motion_files import write_motion

if TYPE_CHECKING:
    from pprs_dynamics.app.api.result import Figure


Motion = PlatformMotion | JointMotion
Rows = dict[str, dict[str, Array]]  # curves by quantity and name
MOST_SHOWN, MOST_LIMITS = 12, 6
HIGH = 0.5  # use of a limit, from which on it is shown
RATE = 100.0  # [Hz], the default of play_trajectory


def platform_rows(motion: PlatformMotion) -> Rows:
    """Return position and orientation of the platform over time, from where it starts."""
    return {'position [m]': dict(zip('xyz', (motion.position - motion.position[0]).T,
                                     strict=True)),
            'angle [rad]': {'tilt': motion.tilt, 'turn': motion.turn}}


def drive_rows(experiment: Experiment, motion: Motion) -> Rows:
    """Return position, velocity, acceleration and effort of every drive over time."""
    model = experiment.model
    forces = model.drive_forces(motion)
    state = forces.mechanism
    return {f'{name} [{common_unit(model.units, unit).replace("^2", "²")}]':
            dict(zip(model.drives, values.T, strict=True))
            for name, unit, values in (
                ('position', 'm', state.position), ('velocity', 'm/s', state.velocity),
                ('acceleration', 'm/s^2', state.acceleration), ('effort', 'N', forces.total))}


@dataclass(frozen=True, repr=False, eq=False)
class ExperimentResult(Result):
    """Result of `pprs next-experiment`.

    Parameters
    ----------
    inputs : Inputs
        Model and recordings.
    design : Experiment
        The motion at any time, and what it promises.
    motion : PlatformMotion or JointMotion
        Sampled.
    purpose : {'separate', 'commission'}
        Option of the command.
    seed : int
        Seed of the search.
    rate : float
        Rate of the samples [Hz].
    """

    rows = 'contests'  # what `table` shows
    json_of = 'design'
    json_keys = ('purpose', 'seed', 'rate')
    inputs: Inputs
    design: Experiment
    motion: PlatformMotion | JointMotion
    purpose: str
    seed: int
    rate: float

    def save(self, path: str | PathLike[str]) -> None:
        """Write the motion as a CSV that `play_trajectory` plays.

        Raises
        ------
        UnreadableFileError
            Where it cannot be written.
        """
        write_motion(path, self.inputs.model.drives, self.motion)

    @property
    def _contests(self) -> PlainTable:
        """Pairs of effects with their evidence, now and expected."""
        return ('if the truth is', 'and the rival', 'now', 'expected', 'chance'), [
            (contest.truth, contest.rival, f'{contest.evidence_now:.0f}',
             f'{contest.expected_evidence:.0f}', f'{contest.probability:.0%}')
            for contest in self.design.contests]

    @property
    def _accuracies(self) -> PlainTable:
        """Numbers with their standard deviations, before and after."""
        def number(value: float) -> str:
            return 'unknown' if value == float('inf') else f'{value:.2g}'
        return ('parameter', 'std now', 'std after', 'relevant from', 'unit'), [
            (accuracy.label, number(accuracy.std_before), number(accuracy.std_after),
             f'{accuracy.scale:.3g}', accuracy.unit)
            for accuracy in self.design.accuracies]

    @property
    def _limits(self) -> list[tuple[str, float]]:
        """Every limit with the share of it that is used, the fullest first."""
        return sorted(self.design.limits.items(), key=lambda item: -item[1])

    def view(self) -> Any:
        """Return purpose, expected evidence and used limits of a motion, for the terminal."""
        parts: list[Any] = [f'[bold]{escape(self.design.text)}[/]']
        if self.design.contests:
            parts.append(titled_table('Evidence, now and expected', self._contests, right=()))
        if self.design.accuracies:
            headings, rows = self._accuracies
            parts.append(titled_table(
                'Standard deviations of parameters, now and after this motion',
                (headings, rows[:MOST_SHOWN]), right=(1, 2, 3)))
            if len(rows) > MOST_SHOWN:
                parts.append(f'… and {len(rows) - MOST_SHOWN} more, in --json')
        used = [f'{name} {share:.0%}' for name, share in self._limits if share >= HIGH]
        parts.append(f'Use of the limits: {", ".join(used[:MOST_LIMITS])}; all others less.')
        return stacked(*parts)

    def page(self) -> Page:
        """Return a page: expected evidence, curves, and use of the limits."""
        design, motion = self.design, self.motion
        assert motion.time is not None
        page = Page('The next experiment')
        page.text(design.text, 'lead')
        if design.contests:
            page.table(*self._contests,
                       caption='Evidence is the cost of the rival minus that of the truth, in a '
                       'diagnosis of all recordings. The chance is that of the rival no longer '
                       'being reported.')
        if isinstance(motion, PlatformMotion):
            page.figure(charts.stacked(motion.time, platform_rows(motion)),
                        'The motion of the platform, from where it starts.', over_time=True)
        with page.fold('Every drive'):
            page.figure(charts.stacked(motion.time, drive_rows(design, motion)),
                        'Position, velocity, acceleration and effort of every drive.',
                        over_time=True)
        with page.fold('Use of the limits'):
            page.table(('limit', 'use'), [(name, f'{share:.0%}') for name, share in self._limits],
                       caption='Share of each limit, less a margin, that the motion uses; checked '
                       'at 500 Hz.')
        if design.accuracies:
            with page.fold('How well parameters would be known'):
                page.table(*self._accuracies, caption='Standard '
                           'deviations (std). Each uncertain effect is fitted alone with the '
                           'model. A parameter is relevant from the size in the fourth column '
                           'on; for numbers of the model this is their tolerance.')
        return page

    def plot(self) -> Figure:
        """Return a picture: where the platform or every joint goes."""
        motion = self.motion
        assert motion.time is not None
        return plot_over_time(motion.time, drive_rows(self.design, motion) if isinstance(
            motion, JointMotion) else platform_rows(motion))


def next_experiment(
    model: Model, recordings: Recordings = (), *, purpose: str = 'separate',
    duration: float = 20.0, seed: int = 0, rate: float = RATE, topic: str | None = None,
    progress: Progress | None = None,
) -> ExperimentResult:
    """Design the motion that best separates the remaining candidates.

    Parameters
    ----------
    model : DriveModel or path
    recordings : path, Recording, or a sequence of them
    purpose : {'separate', 'commission'}
        What the recordings leave open; or a first motion of a new robot, without recordings.
    duration : float
        [s]
    seed : int
        Of the search.
    rate : float
        Of the samples [Hz].
    topic, progress : optional
        As in `compare`.

    Returns
    -------
    ExperimentResult

    Raises
    ------
    PurposeError
        For 'separate' without recordings.
    NoMotionError
        Where the limits leave no room.
    PprsError
        As `diagnose`.
    """
    inputs = Inputs.of(model, recordings, (), topic, progress)
    designed = design(inputs.model, inputs.fitted, purpose, duration=duration, seed=seed,
                      progress=stage(progress, 'designing'))
    count = int(duration * rate + 1e-9) + 1
    return ExperimentResult(inputs, designed, designed.motion(np.arange(count) / rate), purpose,
                            seed, rate)
