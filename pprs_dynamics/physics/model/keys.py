# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Every key of a model file, declared once: type, size, unit, rule and description.

The file loader, the nodes' parameter descriptors and the documentation read this table.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from pprs_dynamics.errors import ModelError

EQUATIONS = ('corrected', 'printed')
ANY = -1
LARGEST = 1e300  # beyond it is no physical quantity, and squares overflow
APPROACHES = ('whole_mechanism', 'independent_chains')
# Units of recorded efforts, and what they are in N m or N; amperes are multiplied by the gain.
EFFORT_UNITS = {'N m': 1.0, 'N': 1.0, 'A': 1.0, 'mN m': 1e-3, 'mN': 1e-3, 'kN m': 1e3, 'kN': 1e3,
                'N cm': 1e-2, 'kgf cm': 0.0980665, 'kgf m': 9.80665, 'kgf': 9.80665,
                'lbf in': 0.1129848290276167}
ROBOT = 'robot'  # block that describes a mechanism
DRIVES_KEY, GAIN, LOCKED = 'robot.drives', 'robot.gain', 'robot.locked.'
FILES = ('robot.urdf', 'robot.mjcf')  # keys that hold paths
LOOPS = ('spherical', 'revolute', 'universal', 'cylindrical', 'prismatic', 'fixed')
POSE = '_pose'
JOINTS, MOTORS, HOME = 'friction.joints.', 'friction.motors.', 'robot.home.'
# Blocks whose keys are not listed one by one.
ADDED = ('effects.', 'uncertainties.', 'tolerances.', 'history.', 'joint_map.', 'joint_prefix',
         'columns.', 'effort_kind', 'reference')
# Keys of ROS 2 itself and of single nodes, which may stand in the same file.
NODE_KEYS = frozenset({
    'max_age', 'source', 'file', 'rate', 'points', 'repeat', 'duration', 'seed', 'lead_in', 'ahead',
    'stiffness', 'damping', 'use_effort', 'command_timeout', 'actuation_delay', 'window',
    'error_span', 'update_rate', 'diagnose_every', 'diagnose_span', 'frame_id',
    'encoder_resolution', 'effort_noise', 'bandwidth', 'damping_ratio', 'injected_effects',
    'injected_scale', 'autostart', 'effort_limits', 'feedforward_scale', 'limit_policy',
    'missing_derivatives', 'timeout_action', 'warning_margin', 'lag_warning', 'action',
    'controller_timeout', 'demo', 'max_ahead', 'max_duration', 'ramp_time', 'stop_time',
    'feedforward', 'tf_prefix', 'use_sim_time', 'start_type_description_service'})
NODE_PREFIXES = ('qos_overrides.',)


@dataclass(frozen=True)
class Key:
    """One key of a model file.

    Parameters
    ----------
    name : str
        Full dotted name.
    description : str
    unit : str
        Empty for words and pure numbers.
    size : int or None
        Length of a list, ANY for any; None for a single value.
    lower, upper : float
        Bounds, both allowed.
    positive : bool
        True where 0 is not allowed either.
    choices : tuple of str
        Words that are allowed, for a key that holds one; () for numbers.
    is_text : bool
        True for a name, or a list of names.
    may_be_empty : bool
        True for a list, or a name, that says nothing where it is empty.
    default : object
        Value where a file is silent; None where the file must have it.
    """

    name: str
    description: str
    unit: str = ''
    size: int | None = None
    lower: float = -math.inf
    upper: float = math.inf
    positive: bool = False
    choices: tuple[str, ...] = ()
    is_text: bool = False
    may_be_empty: bool = False
    default: Any = None

    @property
    def is_number(self) -> bool:
        """Whether it holds numbers, not words."""
        return not (self.choices or self.is_text)

    @property
    def rule(self) -> str:
        """The requirement on a value, completing "must ..."."""
        if self.choices:
            kind = 'one' if self.size is None else 'a list'
            return f'be {kind} of {", ".join(self.choices)} ({self.description})'
        kind = 'name' if self.is_text else 'finite number'
        form = (f'a {kind}' if self.size is None else f'a list of {kind}s' if self.is_text
                or self.size == ANY else f'a list of {self.size} {kind}s')
        has_lower, has_upper = self.lower > -math.inf, self.upper < math.inf
        bounds = (f'between {self.lower:g} and {self.upper:g}' if has_lower and has_upper else
                  ' and '.join(text for text, is_bound in (
                      ('greater than 0', self.positive), (f'at least {self.lower:g}', has_lower),
                      (f'at most {self.upper:g}', has_upper)) if is_bound))
        unit = f' [{self.unit}]' if self.unit else ''
        return ' '.join(filter(None, ('be', form, bounds, f'({self.description}{unit})')))

    def check(self, value: Any) -> Any:
        """Return the value as a word, a float or a tuple of these, or raise ModelError."""
        is_list = hasattr(value, '__len__') and not isinstance(value, (str, bytes, dict))
        elements = list(value) if is_list else [value]
        has_length = (self.size in (ANY, len(elements)) or (self.may_be_empty and not elements)
                      if is_list else self.size is None)
        if not has_length or not all(map(self._allows, elements)):
            raise ModelError(self.name, elements if is_list else value, self.rule)
        found = [element if isinstance(element, str) else float(element) for element in elements]
        return tuple(found) if is_list else found[0]

    def _allows(self, element: Any) -> bool:
        """Return whether a value, or an element of a list, is one."""
        if self.choices:
            return isinstance(element, str) and element in self.choices
        if self.is_text:
            return isinstance(element, str) and bool(
                element.strip() or (self.may_be_empty and not element))
        # Compared before it is converted: a whole number of any length compares.
        return (isinstance(element, (int, float)) and not isinstance(element, bool)
                and -LARGEST <= element <= LARGEST and self.lower <= element <= self.upper
                and (element > 0 or not self.positive))


def _friction(joint: str, where: str, symbol: str) -> tuple[Key, ...]:
    return (
        Key(f'friction.{joint}.viscous', f'c_{symbol}, viscous friction in {where}',
            'N m s/rad', lower=0),
        Key(f'friction.{joint}.coulomb', f'mu_{symbol}, Coulomb friction in {where}', lower=0),
        Key(f'friction.{joint}.diameter', f'd_{symbol}, diameter in {where}', 'm', lower=0))


KEYS: dict[str, Key] = {key.name: key for key in (
    Key('equations', "the paper's (7), (12), (13) corrected or to the letter",
        choices=EQUATIONS),
    Key('geometry.base_radius', 'R, radius of the base', 'm', positive=True),
    Key('geometry.platform_radius', 'r, radius of the platform', 'm', positive=True),
    Key('geometry.rod_length', 'l, length of the guiding rods', 'm', positive=True),
    Key('geometry.chain_angles', 'delta_i, chains around the base', 'rad', size=3),
    Key('geometry.platform_angles', "delta'_i, joints around the platform", 'rad', size=3),
    Key('geometry.elbow', 'branch of the rods', choices=('up', 'down')),
    Key('masses.platform', 'M, mass of the platform', 'kg', lower=0),
    Key('masses.payload', 'm, mass of the manipulated object', 'kg', lower=0),
    Key('masses.slides', 'm_1..m_3, masses of the slides', 'kg', size=3, lower=0),
    Key('masses.lifts', 'm_4..m_6, masses of the lifts', 'kg', size=3, lower=0),
    Key('masses.rods', 'm_b, masses of the guiding rods', 'kg', size=3, lower=0),
    Key('masses.centre', 'centre of mass of platform and payload, in platform', 'm', size=3),
    Key('masses.inertia', 'xx yy zz xy xz yz about that centre, in platform', 'kg m^2', size=6),
    Key('gravity', 'gravity in base', 'm/s^2', size=3),
    Key('friction.approach', 'how passive friction reaches the drives', choices=APPROACHES),
    Key('friction.reversal_velocity', 'width in which sgn turns over in drives', 'm/s',
        positive=True),
    Key('friction.reversal_velocities', 'width drive by drive; 0: friction.reversal_velocity',
        'm/s', size=6, lower=0, default=(0.0,) * 6),
    Key('friction.reversal_rate', 'width in which sgn turns over in passive joints', 'rad/s',
        positive=True),
    Key('friction.drives.viscous', 'c_i, viscous friction of the drives', 'N s/m', size=6,
        lower=0),
    Key('friction.drives.coulomb', 'mu of the drives', size=6, lower=0),
    *_friction('revolute', 'C_i', 'r'),
    *_friction('spherical', 'A_i', 's'),
    Key('limits.slide_stroke', 'lowest and highest position of the slides', 'm', size=2,
        default=(-0.3, 0.3)),
    Key('limits.lift_stroke', 'lowest and highest position of the lifts', 'm', size=2,
        default=(-0.1, 0.8)),
    Key('limits.effort', 'largest absolute force of each drive', 'N', size=6, positive=True,
        default=(100.0,) * 6),
    Key('limits.condition_number', 'largest condition number of the drive Jacobian', lower=1,
        default=20.0),
    Key('limits.rod_sine', 'smallest |sin u_i|', positive=True, upper=1, default=0.05),
    Key('limits.rod_cosine', 'smallest |cos u_i| for independent_chains', positive=True,
        upper=0.5, default=0.05),
)}


@cache
def mechanism_keys(count: int) -> dict[str, Key]:
    """Return the keys of a mechanism with that many drives, but for those by names of its own."""
    zeros, ones = (0.0,) * count, (1.0,) * count
    # What a description may hold; an empty list is what it says.
    described: dict[str, Any] = {'may_be_empty': True, 'default': ()}

    def drives(name: str, description: str, unit: str = '', **more: Any) -> Key:
        return Key(name, f'{description}, of each of {DRIVES_KEY}', unit, size=count,
                   **{'default': zeros, **more})

    def links(name: str, description: str, unit: str) -> Key:
        return Key(name, f'{description}; without it, as the URDF says', unit, size=ANY,
                   may_be_empty=True, default=())

    return {key.name: key for key in (
        Key('robot.urdf', "path of the robot's URDF, from the folder of this file", is_text=True,
            may_be_empty=True, default=''),
        Key('robot.mjcf', "path of the robot's MJCF instead", is_text=True, may_be_empty=True,
            default=''),
        Key('friction.reversal_rate', 'width in which sgn turns over in passive joints that turn',
            'rad/s', positive=True, default=0.01),
        Key('friction.reversal_slide', 'width in which sgn turns over in passive slides', 'm/s',
            positive=True, default=0.001),
        Key('robot.base', 'link that does not move', is_text=True),
        Key('robot.tool', 'link that carries the load', is_text=True),
        Key(DRIVES_KEY, 'revolute and prismatic joints that are driven', size=count, is_text=True),
        drives(GAIN, 'torque, or force, per ampere', 'N m/A, N/A', positive=True,
               default=ones),
        drives('robot.gear_ratio', 'turns of the motor per turn of the joint; without it, as '
               'the URDF says, else 1', '', positive=True, **described),
        Key('robot.effort_unit', f'unit of the efforts of recordings; A: times {GAIN}',
            choices=tuple(EFFORT_UNITS), default='N m'),
        Key('robot.gravity', 'gravity in the base; without it, as an MJCF says, else -9.81 '
            'along z', 'm/s^2', size=3, **described),
        drives('robot.armature', 'inertia of the rotor, seen at the joint; without it, as the '
               'MJCF says, else 0', 'kg m^2, kg', lower=0, **described),
        links('links.mass', 'mass of what each joint moves up to the next', 'kg'),
        links('links.moment', 'x y z of mass times centre, in the frame of each joint', 'kg m'),
        links('links.inertia', 'xx yy zz xy xz yz about the origin of each joint', 'kg m^2'),
        drives('friction.viscous', 'F_v, viscous friction; without it, as an MJCF says, else 0',
               'N m s/rad, N s/m', lower=0, **described),
        drives('friction.coulomb', 'F_c, dry friction; without it, as an MJCF says, else 0',
               'N m, N', lower=0, **described),
        drives('friction.offset', 'constant effort in addition to weight and friction', 'N m, N'),
        Key('friction.reversal_velocity', 'width in which sgn turns over', 'rad/s, m/s',
            positive=True, default=0.01),
        drives('friction.reversal_velocities',
               'width in which sgn turns over; 0: friction.reversal_velocity', 'rad/s, m/s',
               lower=0),
    )}


# Keys below names that a file gives: of loops, joints and links.
OF_LOOP = {'type': Key('', 'kind of the closure', choices=LOOPS)} | {
    f'{side}.{name}': key for side in 'ab' for name, key in (
        ('link', Key('', 'link that the closure is on', is_text=True)),
        ('xyz', Key('', 'place of the closure on it', 'm', size=3, default=(0.0,) * 3)),
        ('rpy', Key('', 'roll, pitch and yaw of the closure on it', 'rad', size=3,
                    default=(0.0,) * 3)))}
OF_JOINT = {
    'viscous': Key('', 'viscous friction', 'N m s/rad, N s/m', lower=0, default=0.0),
    'torque': Key('', 'dry friction, whatever the load', 'N m, N', lower=0, default=0.0),
    'coulomb': Key('', 'dry friction over the load across the axis', '', lower=0, default=0.0),
    'radius': Key('', 'radius at which it acts; of a slide 1', 'm', lower=0, default=0.0)}
# A key for each name that the file gives, or the keys of a block for each.
NAMED: dict[str, Key | dict[str, Key]] = {
    'robot.loops.': OF_LOOP, JOINTS: OF_JOINT,
    HOME: Key('', 'position near which the loops close', 'rad, m'),
    LOCKED: Key('', 'position at which the joint is locked', 'rad, m'),
    MOTORS: Key('', 'turns of a motor per turn of a joint, of motors that move several')}
HOME_POSE = Key('', 'x y z qx qy qz qw in the base near which the loops close', 'm', size=7)


def named_keys(parameters: Iterable[str]) -> dict[str, Key]:
    """Return the keys of a robot below names that its file gives, out of those of the file."""
    found = {}
    for name in parameters:
        prefix = next((prefix for prefix in NAMED if name.startswith(prefix)), '')
        keys = NAMED.get(prefix)
        if isinstance(keys, Key):
            is_pose = prefix == HOME and name.endswith(POSE)
            found[name] = replace(HOME_POSE if is_pose else keys, name=name)
        elif keys and '.' in name.removeprefix(prefix):
            block = prefix + name.removeprefix(prefix).partition('.')[0]
            found.update((f'{block}.{last}', replace(key, name=f'{block}.{last}'))
                         for last, key in keys.items())
    return found


def is_described(names: Iterable[str]) -> bool:
    """Return whether keys are those of a robot that a description file describes."""
    return any(name.startswith('robot.') for name in names)


def title_of(parameters: Mapping[str, Any]) -> str:
    """Return the kind of robot that keys and values describe, for a sentence."""
    if any(name.startswith('robot.loops.') or (name == 'robot.mjcf' and value)
           for name, value in parameters.items()):
        return 'a robot with loops'
    if not is_described(parameters):
        return 'a 3-PPRS'
    return 'a single axis' if len(parameters.get(DRIVES_KEY, ())) == 1 else 'a serial arm'


def keys_of(parameters: Mapping[str, Any]) -> dict[str, Key]:
    """Return the keys of the kind of model that some keys and values belong to."""
    if is_described(parameters):
        drives = parameters.get(DRIVES_KEY, ())
        count = len(drives) if isinstance(drives, (list, tuple)) and drives else 1
        return {**mechanism_keys(count), **named_keys(parameters)}
    return KEYS


# Names of all keys of the model, of whatever kind.
NAMES = frozenset({*KEYS, *mechanism_keys(1)})


def below(values: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Return the keys and values below a prefix."""
    return {key.removeprefix(prefix): value for key, value in values.items()
            if key.startswith(prefix)}


def blocks_below(values: Mapping[str, Any], prefix: str) -> dict[str, dict[str, Any]]:
    """Return the blocks below a prefix by their names; the value of a name itself has key ''."""
    blocks: dict[str, dict[str, Any]] = {}
    for key, value in below(values, prefix).items():
        name, _, rest = key.partition('.')
        blocks.setdefault(name, {})[rest] = value
    return blocks


def as_list(value: Any) -> Any:
    """Return a tuple as a list, as in a file, and any other value unchanged."""
    return list(value) if isinstance(value, tuple) else value


def set_number(values: dict[str, Any], key: str, element: int | None, number: float) -> None:
    """Put a number into a model's values, as one element where the key holds several."""
    values[key] = number if element is None else tuple(
        number if k == element else old for k, old in enumerate(values[key]))
