# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Pages of the catalogue: each effect's card, its parameters, and a plot of its law.

The plot shows the effect's force on the drive where it is largest, along a random motion of the
paper's robot, with typical parameters. Effects that hardly act in that robot are plotted for a
small arm.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from inspect import getdoc
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use('Agg')
import made_up_arm
import matplotlib.pyplot as plt
import numpy as np

from pprs_dynamics import DriveModel, JointMotion
from pprs_dynamics.arrays import Array
from pprs_dynamics.physics.effects.catalogue import CATALOGUE
from pprs_dynamics.physics.effects.drive_effect import DriveEffect, MeasurementEffect
from pprs_dynamics.physics.effects.effect import CatalogueEffect
from pprs_dynamics.physics.mechanism.motion import spline_derivatives
from pprs_dynamics.physics.mechanism.paths import Excitation
from pprs_dynamics.physics.mechanism.state import PLATFORM

SECONDS, RATE = 20.0, 200.0
# What an effect's force is drawn over, where it is not the drive's velocity.
OVER = {'counterbalance': 'position', 'current_gain': 'effort',
        'drive_inertia': 'acceleration', 'drive_spring': 'position',
        'eccentric_encoder': 'position', 'effort_gain': 'effort', 'elastic_joint': 'acceleration',
        'effort_offset': 'time',
        'force_ripple': 'position', 'friction_drift': 'time',
        'homing_error': 'position', 'link_mass': 'position', 'joint_friction': 'velocity',
        'payload_mass': 'position', 'payload_offset': 'position',
        'platform_inertia': 'acceleration', 'stop_contact': 'position', 'joint_spring': 'position',
        'base_tilt': 'position', 'external_wrench': 'position'}
# Values of one drive or of the structure where the parameters' scales do not show the law.
TYPICAL = {'asymmetric_friction': {'force_forward': 0.8, 'force_backward': 0.4},
           'force_ripple': {'force': 0.3, 'phase': 0.0, 'pitch': 0.01},
           'counterbalance': {'force': 10.0, 'stiffness': 0.0, 'ratio': 0.6, 'position': 0.0},
           'current_gain': {'temperature': 0.002},
           'coupled_drives': {'wrist.coulomb': 1.0},
           'eccentric_encoder': {'amplitude': 0.001, 'phase': 0.0, 'pitch': 0.2},
           'elastic_joint': {'compliance': 1e-3},
           'friction_temperature': {'coulomb': -0.02, 'viscous': -0.2, 'reference': 40.0},
           'friction_drift': {'force': 0.5, 'time': 10.0},
           'hysteresis': {'force': 0.5, 'distance': 0.002},
           'homing_error': {'zero': 0.002},
           'joint_friction': {'spherical.torque': 0.03},
           'joint_spring': {'revolute.stiffness': 0.5, 'revolute.position': 1.3},
           'link_mass': {'rods.mass': 0.1},
           'gear_efficiency': {'driving': 0.25, 'driven_back': 0.1},
           'load_friction': {'coefficient': 0.05},
           'lost_motion': {'play': 0.002},
           'stop_contact': {'upper': 100.0, 'position': 0.04},
           'stribeck_friction': {'force': 0.5, 'velocity': 0.01},
           'effort_filter': {'time_constant': 0.02},
           'time_delay': {'delay': 0.02}}
# Drawn of the arm: so stiff are screws that a 3-PPRS does not show it.
IN_ARM = ('elastic_joint',)
UNITS = {'time': 's', 'position': 'm', 'velocity': 'm/s', 'acceleration': 'm/s²', 'effort': 'N'}


def values(effect: type[CatalogueEffect]) -> dict[str, float]:
    """Return typical values: those above, else each required parameter's scale."""
    return TYPICAL.get(effect.name) or {
        each.name: each.scale for each in effect.parameters if each.default is None
    } or {each.name: each.scale for each in effect.parameters[:1]}


def block(effect: type[CatalogueEffect], drive: str) -> dict[str, Any]:
    """Return the keys of a model file with the effect alone, on one drive or in the structure."""
    middle = f'effects.{effect.name}.' + (f'{drive}.' if issubclass(effect, DriveEffect) else '')
    return {'effects.active': [effect.name],
            **{middle + name: value for name, value in values(effect).items()}}


@cache
def platform() -> tuple[DriveModel, JointMotion]:
    """Return the paper's robot and a motion of it."""
    time = np.arange(0, SECONDS, 1 / RATE)
    warming = {'temperature': np.tile(20 + time, (6, 1)).T}  # a kelvin a second
    model = DriveModel.load()
    state = model.mechanism(Excitation(SECONDS, seed=3).motion(time))
    return model, JointMotion(state.position, state.velocity, state.acceleration, time,
                              channels=warming)


def platform_law(effect: type[CatalogueEffect]) -> tuple[Mapping[str, Array], Array, str]:
    """Return states of a drive of the 3-PPRS by name, what the effect adds to it, its name."""
    model, motion = platform()
    changed = DriveModel.from_parameters({**model.values, **block(effect, 'slide_1')})
    plain = model.drive_forces(motion)
    state = plain.mechanism
    at = motion
    if changed.position_effects:
        # Positions are read with the error, so that the model is evaluated at another pose.
        q = (state.position + changed.position_error(state.position)
             + changed.loaded_position_error(state.transmitted))
        at = JointMotion(q, *spline_derivatives(motion.time, q, is_pose=False), motion.time)
    forces = changed.drive_forces(at)
    added = changed.measured(forces).total - plain.total
    if changed.position_effects:
        added = -added
    drive = int(np.argmax((added ** 2).sum(axis=0)))
    return ({'time': motion.time, 'position': state.position[:, drive],
             'velocity': state.velocity[:, drive], 'acceleration': state.acceleration[:, drive],
             'effort': plain.total[:, drive]}, added[:, drive], model.drives[drive])


def arm_law(effect: type[CatalogueEffect]) -> tuple[Mapping[str, Array], Array, str]:
    """Return the same of a turning joint of a small arm."""
    with tempfile.TemporaryDirectory() as folder:
        model = made_up_arm.real_arm(Path(folder), **{
            'friction.motors.wrist.turn': 1.0, 'friction.motors.wrist.swing': 1.0})
        motion = made_up_arm.motion(SECONDS, RATE, seed=3)
        changed = DriveModel.from_parameters(
            {**model.values, **block(effect, 'swing')}, model.source)
    plain, at = model.drive_forces(motion), motion
    if changed.position_effects:  # as in `platform_law`
        read = (motion.position + changed.position_error(motion.position)
                + changed.loaded_position_error(plain.mechanism.transmitted))
        rate = np.gradient(read, motion.time, axis=0)
        at = replace(motion, position=read, velocity=rate,
                     acceleration=np.gradient(rate, motion.time, axis=0))
    added = changed.drive_forces(at).total - plain.total
    if changed.position_effects:
        added = -added
    # At the ends differences look to one side only.
    added, inner = added[2:-2], slice(2, -2)
    joint = int(np.argmax((added ** 2).sum(axis=0) * [unit.turns for unit in model.units]))
    return ({'time': motion.time[inner], 'position': motion.position[inner, joint],
             'velocity': motion.velocity[inner, joint],
             'acceleration': motion.acceleration[inner, joint],
             'effort': plain.total[inner, joint]}, added[:, joint], model.drives[joint])


def draw(effect: type[CatalogueEffect], file: Path) -> None:
    """Draw what an effect adds over time and over what it depends on most."""
    in_arm = PLATFORM not in effect.acts_in or effect.name in IN_ARM
    states, added, drive = arm_law(effect) if in_arm else platform_law(effect)
    over = OVER.get(effect.name, 'velocity')
    force, units = ('N m', {**UNITS, 'position': 'rad', 'velocity': 'rad/s',
                            'acceleration': 'rad/s²'}) if in_arm else ('N', UNITS)
    figure, axes = plt.subplots(1, 1 if over == 'time' else 2, figsize=(8.0, 2.6), sharey=True,
                                layout='constrained', squeeze=False)
    for panel, name in zip(axes[0], ('time', over), strict=False):
        panel.plot(states[name], added, '-' if name == 'time' else '.', color='#2563eb',
                   linewidth=1.0, markersize=1.5, rasterized=name != 'time')
        panel.set_xlabel(f'{name} [{units[name]}]')
        panel.grid(alpha=0.3)
    axes[0, 0].set_ylabel(f'added on {drive} [{force}]')
    figure.savefig(file, dpi=150, metadata={'Date': None})
    plt.close(figure)


def symbols_of(effect: type[CatalogueEffect]) -> Iterator[tuple[str, str, str]]:
    """Yield symbols, meaning and unit of the rows of docs/effects.md that a law needs.

    Of what stands in the law and is no parameter of the effect.
    """
    text = (Path(__file__).parent / 'effects.md').read_text(encoding='utf-8')
    table = text.split('## Symbols')[1].split('\n## ')[0]
    parameters = {each.symbol for each in effect.parameters}
    for symbols, where, meaning, unit in re.findall(
            r'^\| (`.+?) \| (.+?) \| (.+?) \| (.+?) \|$', table, re.M):
        is_meant = where == 'all' or f'`{effect.name}`' in where or (
            where == 'what sensors say' and issubclass(effect, MeasurementEffect))
        if is_meant and any(re.search(rf'(?<!\w){re.escape(each)}(?!\w)', effect.card.equation)
                            for each in set(re.findall('`(.+?)`', symbols)) - parameters):
            yield symbols, meaning.replace('](', '](../../'), unit  # from where its page is


def page(effect: type[CatalogueEffect]) -> str:
    """Return an effect's page."""
    card, symbols = effect.card, [f'| {" | ".join(row)} |' for row in symbols_of(effect)]
    effect = platform()[0].bound(effect)
    given = ', '.join(f'`{name}` = {value:g}' for name, value in values(effect).items())
    rows = [f'| `{each.name}` | {each.symbol} | {each.unit} | {each.description} | '
            f'{"" if each.default is None else f"{each.default:g}"} |'
            for each in effect.parameters]
    kinds = {'platform': '3-PPRS', 'slide': 'single axis', 'mechanism': 'arm or robot with loops'}
    return '\n'.join([
        f'# {effect.name}', '', (getdoc(effect) or '').splitlines()[0], '',
        '```text', card.equation, '```', '',
        f'![What {effect.name} adds to a drive]({effect.name}.svg)', '',
        f'With {given}.', '',
        f'**In the residual:** {card.looks_like}.', '', f'**Usual causes:** {card.causes}.', '',
        f'**To confirm it:** {card.confirm}.', '',
        '| parameter | symbol | unit | meaning | default |', '|---|---|---|---|---|', *rows, '',
        *(['| else in the law | meaning | unit |', '|---|---|---|', *symbols, '']
          if symbols else []),
        'On which machines it was seen: '
        '[table](../../effects.md#on-which-machines-they-were-seen).', '',
        f'Acts in: {", ".join(kinds[kind] for kind in kinds if kind in effect.acts_in)}. '
        f'Source: `pprs_dynamics/physics/effects/laws/{effect.name}.py`.', '',
        f'Reference: {card.reference}.', ''])


def write(target: Path) -> None:
    """Write pages and plots into a folder; those of effects that are gone are removed."""
    target.mkdir(parents=True, exist_ok=True)
    for file in target.iterdir():
        if file.stem not in CATALOGUE:
            file.unlink()
    for name, effect in CATALOGUE.items():
        file, text = target / f'{name}.md', page(effect)
        if file.is_file() and file.read_text(encoding='utf-8') == text:
            continue
        draw(effect, target / f'{name}.svg')
        file.write_text(text, encoding='utf-8')
