"""Model files: YAML that is also a ROS 2 parameter file -> DriveModel or AxisModel.

The same `build_model` serves files and the nodes' parameters: both are flat keys and values.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from pprs_dynamics.effects.active_friction import ActiveFriction
from pprs_dynamics.effects.axis_friction import AxisFriction, AxisOffset
from pprs_dynamics.effects.effect import Effect
from pprs_dynamics.effects.passive_friction import (
    IndependentChainsFriction,
    JointFriction,
    PassiveFriction,
    WholeMechanismFriction,
)
from pprs_dynamics.effects.structure_effect import BodyEffect
from pprs_dynamics.errors import MISSING, ModelError, UnreadableFileError
from pprs_dynamics.mechanism.reversal import Reversal
from pprs_dynamics.mechanism.robot import Geometry, Masses, Robot
from pprs_dynamics.model.axis_model import AxisModel
from pprs_dynamics.model.bounded_yaml import parse, read_text
from pprs_dynamics.model.drive_model import DriveModel
from pprs_dynamics.model.effects_block import ADDED, added_effects, check_tolerances, suggestion
from pprs_dynamics.model.keys import (
    AXIS_KEYS,
    KEYS,
    NODE_KEYS,
    NODE_PREFIXES,
    is_axis,
    keys_of,
)
from pprs_dynamics.model.limits import Limits

DEFAULT_MODEL = 'config/paper.yaml'


def find_file(path: str | PathLike[str]) -> Path:
    """Return the file itself, or the package's own of that name (e.g. config/paper.yaml).

    Raises
    ------
    UnreadableFileError
        Where there is neither.
    """
    given = Path(path)
    if given.exists() or given.is_absolute():
        return given
    package = Path(__file__).resolve().parents[1]
    # A source tree or an editable install; a `pip install --target`; a prefix or workspace,
    # four folders above <prefix>/lib/pythonX.Y/site-packages/pprs_dynamics.
    roots = [package.parent, package.parent / 'share/pprs_dynamics']
    roots += [prefix / 'share/pprs_dynamics' for prefix in package.parents[2:5]]
    roots.append(Path(sys.prefix) / 'share/pprs_dynamics')
    for root in roots:
        if (root / given).is_file():
            return root / given
    raise UnreadableFileError(path, 'no such file, nor one of that name in the package')


def load_model(path: str | PathLike[str] = DEFAULT_MODEL) -> DriveModel | AxisModel:
    """Read a model file of either kind; see `DriveModel.load`."""
    file = find_file(path)
    return build_model(read_parameters(file), source=str(file))


def read_parameters(path: str | PathLike[str]) -> dict[str, Any]:
    """Return the flat keys and values of a ROS 2 parameter file.

    Raises
    ------
    UnreadableFileError
        Where it cannot be read, is not YAML within bounds, or has no `ros__parameters`.
    ModelError
        For a list that mixes whole and decimal numbers, which ROS 2 refuses.
    """
    return parse_parameters(read_text(path), path)


def parse_parameters(text: str, path: str | PathLike[str] = '') -> dict[str, Any]:
    """Return the same of a file's text; `path` is named in errors."""
    flat: dict[str, Any] = {}
    for key, value in _flatten(_parameters_block(path, parse(text, path))):
        if key in flat:
            raise ModelError(key, value, 'stand once: it is given nested and with dots', str(path))
        flat[key] = value
        if isinstance(value, list) and len({type(element) for element in value}) > 1:
            raise ModelError(key, value, 'hold elements of one type, as ROS 2 demands '
                             '(write 0.0, not 0, among decimal numbers)', str(path))
    return flat


def other_nodes(text: str) -> dict[str, Any]:
    """Return the blocks of a parameter file's text that are for single nodes, not the model."""
    content = parse(text)
    chosen = _parameters_block('', content)
    return {node: block for node, block in content.items()
            if block['ros__parameters'] is not chosen}


def build_model(parameters: Mapping[str, Any], source: str = '') -> DriveModel | AxisModel:
    """Build the model from flat keys and values, each checked.

    Parameters
    ----------
    parameters : mapping
        E.g. {'geometry.rod_length': 0.3, ...}; keys of nodes are ignored. With keys of `axis`
        it is a single axis.
    source : str
        Named in errors.

    Raises
    ------
    ModelError
        For a key that is unknown, missing, of the wrong type or impossible.
    """
    try:
        return (_build_axis if is_axis(parameters) else _build_robot)(parameters, source)
    except ModelError as error:
        if error.source:
            raise
        raise ModelError(error.key, error.value, error.rule, source) from None


def build_robot(parameters: Mapping[str, Any], source: str = '') -> DriveModel:
    """Build the model of a 3-PPRS; a single axis is refused.

    Raises
    ------
    ModelError
        As `build_model`.
    """
    model = build_model(parameters, source)
    if isinstance(model, AxisModel):
        key = next(name for name in parameters if is_axis((name,)))
        raise ModelError(key, parameters[key], 'not be there: this needs a 3-PPRS, and a single '
                         'axis is for pprs compare, diagnose, adopt and history', source)
    return model


def default_parameters() -> dict[str, Any]:
    """Return the flat keys and values of the paper's robot."""
    return read_parameters(find_file(DEFAULT_MODEL))


def _checked_values(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of all keys, complete with defaults, and the added blocks as given."""
    values: dict[str, Any] = {}
    keys = keys_of(parameters)
    _require_known(parameters)
    for name, key in keys.items():
        if name in parameters:
            values[name] = key.check(parameters[name])
        elif key.default is None:
            raise ModelError(name, MISSING, key.rule)
        else:
            values[name] = key.default
    check_tolerances(parameters, keys)
    return {**values, **{name: value for name, value in parameters.items()
                         if name.startswith(ADDED)}}


def _build_axis(parameters: Mapping[str, Any], source: str) -> AxisModel:
    values = _checked_values(parameters)
    friction = AxisFriction(values['axis.viscous'], values['axis.coulomb'])
    return AxisModel(
        mass=values['axis.mass'], gravity=values['axis.gravity'],
        effects=(friction, AxisOffset(values['axis.offset']),
                 *added_effects(parameters, AxisModel)),
        reversal=Reversal(values['friction.reversal_velocity']), values=values, source=source)


def _build_robot(parameters: Mapping[str, Any], source: str) -> DriveModel:
    values = _checked_values(parameters)
    for stroke in ('limits.slide_stroke', 'limits.lift_stroke'):
        if not values[stroke][0] < values[stroke][1]:
            raise ModelError(stroke, values[stroke], 'be a lower and a higher position [m]')

    def group(prefix: str) -> dict[str, Any]:
        return {name.removeprefix(prefix): value for name, value in values.items()
                if name.startswith(prefix) and '.' not in name.removeprefix(prefix)}

    robot = Robot(Geometry(**group('geometry.')), Masses(**group('masses.')), values['gravity'])
    limits = Limits(**group('limits.'))
    printed = values['equations'] == 'printed'
    joints = (JointFriction(**group('friction.revolute.')),
              JointFriction(**group('friction.spherical.')))
    passive: PassiveFriction
    if values['friction.approach'] == WholeMechanismFriction.approach:
        passive = WholeMechanismFriction(*joints, printed)
    else:
        passive = IndependentChainsFriction(*joints, printed, limits.rod_cosine)
    effects = (ActiveFriction(**group('friction.drives.')), passive,
               *added_effects(parameters, DriveModel))
    _require_bodies(robot, effects)
    return DriveModel(
        robot=robot, effects=effects, limits=limits,
        reversal=Reversal(_reversal_velocity(values), values['friction.reversal_rate']),
        equations=values['equations'], values=values, source=source)


def _reversal_velocity(values: Mapping[str, Any]) -> float | tuple[float, ...]:
    """Return the width that all drives share, or one for each."""
    common: float = values['friction.reversal_velocity']
    own: tuple[float, ...] = values['friction.reversal_velocities']
    return tuple(one or common for one in own) if any(own) else common


def _require_bodies(robot: Robot, effects: Sequence[Effect]) -> None:
    """Raise ModelError where effects leave bodies that cannot be."""
    for effect in effects:
        if isinstance(effect, BodyEffect):
            robot = effect.changed(robot)
            if not robot.masses.total > 0 or min(robot.masses.rods) < 0:
                raise ModelError(f'effects.{effect.name}', effect.to_file(),
                                 'leave masses greater than 0')


def _require_known(parameters: Mapping[str, Any]) -> None:
    keys = keys_of(parameters)
    for name, value in parameters.items():
        block = name.split('.')[0]
        if name == block and value in (None, {}) and any(
                key.startswith(f'{block}.') for key in (*keys, *ADDED)):
            continue  # a block that somebody left empty says nothing
        if name not in keys and not _is_for_others(name):
            raise ModelError(name, value, 'not be there: no such key'
                             + suggestion(name, (*keys, *NODE_KEYS)))


def is_known(name: str) -> bool:
    """Return whether a model file may hold a key of that name."""
    return name in KEYS or name in AXIS_KEYS or _is_for_others(name)


def _is_for_others(name: str) -> bool:
    """Return whether a key is a node's, or of a block whose keys are not listed one by one."""
    return name in NODE_KEYS or name.startswith((*NODE_PREFIXES, *ADDED))


def _parameters_block(path: object, content: Any) -> Mapping[str, Any]:
    if not isinstance(content, Mapping) or not content:
        raise UnreadableFileError(path, 'not a model file: it must map /** to ros__parameters')
    blocks: dict[str, Mapping[str, Any]] = {}
    for node, block in content.items():
        if not isinstance(block, Mapping) or not isinstance(block.get('ros__parameters'), Mapping):
            raise UnreadableFileError(
                path, f'not a model file: {node} must hold a mapping ros__parameters')
        blocks[node] = block['ros__parameters']
    if '/**' in blocks:
        for node, block in blocks.items():
            for key, _ in _flatten(block) if node != '/**' else ():
                if key in KEYS or key in AXIS_KEYS or key.startswith(ADDED):
                    raise UnreadableFileError(
                        path, f'{key} of the model stands under {node}: put it under /**, for '
                        'every node and command alike')
        return blocks['/**']
    if len(blocks) > 1:
        raise UnreadableFileError(
            path, f'parameters of {len(blocks)} nodes and none for all: put the model under /**')
    return next(iter(blocks.values()))


def _flatten(block: Mapping[Any, Any], prefix: str = '') -> Iterator[tuple[str, Any]]:
    for key, value in block.items():
        if isinstance(value, Mapping) and value:
            yield from _flatten(value, f'{prefix}{key}.')
        else:
            yield f'{prefix}{key}', value
