# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Words for what no effect of the catalogue explains: where it lies, and what to look at."""

from __future__ import annotations

from collections.abc import Sequence

from pprs_dynamics.inference.diagnosis.quantities import listed, sentence
from pprs_dynamics.inference.diagnosis.statements import WORDS, Statement

# What it could come from, and how to look, by what the error depends on.
LEADS = {
    'position': ('a dent, dirt or a joint in the guide or screw, something that catches or '
                 'touches there',
                 'creep over that place both ways: it must stay put; look and feel along the '
                 'guide'),
    'velocity': ('friction of another form than the catalogue\'s, a controller or amplifier that '
                 'behaves otherwise at that speed',
                 'run the drive alone at several constant speeds around there'),
    'direction': ('play, or friction of another form that differs by direction',
                  'approach one position from both sides and compare efforts and encoders'),
    'acceleration': ('play or compliance between drive and load, a saturated amplifier',
                     'repeat the motion at half the speed: what follows acceleration falls to a '
                     'quarter'),
    'load': ('a guide or nut that gives or jams under load',
             'repeat with a known weight more on the platform'),
    'rod_angle': ('something that touches or binds in a passive joint at that angle',
                  'swing the uncoupled rod by hand through that angle'),
    'time': ('something that happened once: a load taken up or put down, a touch, a loose part, a '
             'sensor that jumped',
             'repeat the recording: what comes at the same time belongs to the motion, what does '
             'not happened once'),
    'frequency': ('a vibration of the structure, a controller on the edge of stability, a '
                  'neighbouring machine or the mains',
                  'record at rest, and with other gains: a machine nearby does not care, the '
                  'controller does'),
    'platform': ('something that pulls at the platform or touches it in part of the workspace: a '
                 'hose, a cable, a workpiece',
                 'take away whatever touches the platform and repeat'),
    'drive': ('a coupling of the two drives: a shared cable chain or supply, a bending frame, '
              'cross-talk between sensors',
              'move that drive alone, with this one held still'),
}
SHAPES = {
    'offset': 'a constant', 'range': 'a shift within a range',
    'directed_range': 'a shift against or along the motion, within a range',
    'growth': 'a curve from end to end',
    'directed_growth': 'a curve from end to end that turns over with the direction of motion',
    'one_way': 'a curve for one direction only', 'friction': 'a step where the motion reverses',
    'fading': 'a step where the motion reverses, which fades with speed',
    'fast': 'a curve that shows at speed',
    'scatter': 'scatter larger than elsewhere, with no shift',
    'bump': 'a bump', 'level': 'a slow drift without a pattern',
    'ripple': 'a wave', 'line': 'a vibration at one frequency',
}


def describe_unexplained(
    group: Sequence[Statement], beside_effects: bool,
) -> tuple[str, str, str, str, str]:
    """Return title, what, why, cause and how to confirm, of one pattern on one or more drives."""
    first = group[0]
    drives = listed([one.drive for one in group])
    texts = '; '.join(one.text if len(group) > 1 else one.text.removeprefix(f'{one.drive}: ')
                      for one in group)
    left = 'what the effects found leave' if beside_effects else 'the error'
    what = (f'Something on {drives} that no effect of the catalogue explains, '
            f'{place_of(first.variable)}. Its shape is '
            f'{SHAPES.get(first.kind, "drawn in the report")}: in {left}, {texts}.')
    evidence = max(one.evidence for one in group)
    why = ('Its noise is compared with that of the other drives, which move alike.'
           if first.kind == 'level' else
           f'Noise like this one does not do that (evidence {evidence:.0f}, where 0 is '
           'the threshold), and every effect of the catalogue explains it worse.')
    cause, confirm = LEADS[_lead(first.variable)]
    return f'unknown {place_on(group)}', what, why, sentence(cause), sentence(confirm)


def place_on(group: Sequence[Statement]) -> str:
    """Return on which drives and depending on what a pattern lies."""
    return f'on {listed([one.drive for one in group])}, {place_of(group[0].variable)}'


def place_of(variable: str) -> str:
    """Return in words what an error depends on."""
    if variable == 'frequency':
        return 'at one frequency'
    name, of, other = variable.partition(' of ')
    return f'depending on {WORDS.get(name, name)}{of}{other}'


def _lead(variable: str) -> str:
    if ' of ' in variable:
        return 'drive'
    return 'platform' if variable.startswith('platform') else variable
