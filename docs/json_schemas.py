# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Write the JSON schemas in config/schemas from the dataclasses: python docs/json_schemas.py."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from pprs_dynamics.app.api.adopt import AdoptionResult, AdoptionRunResult
from pprs_dynamics.app.api.compare import ComparisonResult
from pprs_dynamics.app.api.diagnose import DiagnosisResult
from pprs_dynamics.app.api.fit import FitResult
from pprs_dynamics.app.api.next_experiment import ExperimentResult
from pprs_dynamics.inference.diagnosis.live_diagnosis import LiveDiagnosis
from pprs_dynamics.physics.model.ledger import Step
from pprs_dynamics.ros.node.status import NodeStatus
from pprs_dynamics.system.json_records import JsonRecord

FOLDER = Path(__file__).parents[1] / 'config' / 'schemas'
DIALECT = 'https://json-schema.org/draft/2020-12/schema'
# File of a schema: its record, and the fields of other commands that hold one.
RECORDS: dict[str, type[JsonRecord]] = {
    'adopt': AdoptionResult, 'adopt_all': AdoptionRunResult, 'compare': ComparisonResult,
    'diagnose': DiagnosisResult, 'diagnosis': LiveDiagnosis, 'fit': FitResult,
    'history_step': Step, 'next_experiment': ExperimentResult, 'status': NodeStatus}
PLAIN = {str: 'string', bool: 'boolean', int: 'integer', NoneType: 'null'}

Schema = dict[str, Any]


def described(record: type) -> dict[str, str]:
    """Return the descriptions of fields in a NumPy docstring, by name."""
    texts: dict[str, str] = {}
    for base in reversed(record.__mro__):
        block = (inspect.getdoc(base) or '').partition('Parameters\n----------\n')[2]
        for names, kind, text in re.findall(r'^(\w[\w, ]*?)(?: : (.*))?$\n?((?:    .*\n?)*)',
                                            block.partition('\n\n')[0], re.M):
            choices = f'{kind[1:-1]}. ' if kind.startswith('{') else ''
            texts.update(dict.fromkeys(names.split(', '), f'{choices}{" ".join(text.split())}'))
    return texts


def attribute(record: type, name: str) -> tuple[Any, str]:
    """Return type and description of a field or property."""
    found = inspect.getattr_static(record, name, None)
    function = getattr(found, 'fget', getattr(found, 'func', None))
    if function is not None:
        hints = get_type_hints(function, include_extras=True)
        return hints['return'], (inspect.getdoc(function) or '').partition('\n\n')[0]
    return get_type_hints(record, include_extras=True)[name], described(record).get(name, '')


def keys_of(record: type[JsonRecord], parts: dict[str, Schema]) -> tuple[Schema, list[str]]:
    """Return properties and required keys of a record."""
    properties: Schema = {}
    required: list[str] = []
    for key, name, may_be_absent in record.json_entries():
        kind, text = attribute(record, name)
        if key.startswith('**'):
            inner = get_args(kind)[1] if get_origin(kind) is Annotated else kind
            more, needed = keys_of(inner, parts)
            properties.update(more)
            required += needed if inner is kind else []
            continue
        schema = schema_of(kind, parts)
        properties[key] = {**schema, 'description': ' '.join(text.split())} if text else schema
        required = [each for each in required if each != key] + [key] * (not may_be_absent)
    return properties, required


def schema_of(kind: Any, parts: dict[str, Schema]) -> Schema:
    """Return the schema of a type; those of records are added to `parts`."""
    origin, inner = get_origin(kind), get_args(kind)
    if kind is float:
        return {'type': ['number', 'null']}  # null: not finite
    if kind in PLAIN:
        return {'type': PLAIN[kind]}
    if origin is Literal:
        return {'enum': list(inner)}
    if origin in (Union, UnionType):
        return union([schema_of(each, parts) for each in inner])
    if isinstance(kind, type) and issubclass(kind, JsonRecord):
        if kind.__name__ not in parts:
            parts[kind.__name__] = {}  # a record may hold others of its kind
            parts[kind.__name__] = record_schema(kind, parts)
        return {'$ref': f'#/$defs/{kind.__name__}'}
    if origin is not None and issubclass(origin, Mapping):
        return {'type': 'object', 'additionalProperties': schema_of(inner[1], parts)}
    if origin is tuple and inner[-1] is not ...:
        return {'type': 'array', 'prefixItems': [schema_of(each, parts) for each in inner],
                'minItems': len(inner), 'maxItems': len(inner)}
    if origin is not None and issubclass(origin, Sequence):
        return {'type': 'array', 'items': schema_of(inner[0], parts)}
    if kind is Any:
        return {}
    raise TypeError(f'{kind}: no JSON is known of it')


def union(schemas: list[Schema]) -> Schema:
    """Return the schema of what is as one of several."""
    if all(set(schema) == {'type'} for schema in schemas):
        kinds = [each for schema in schemas for each in (
            schema['type'] if isinstance(schema['type'], list) else [schema['type']])]
        return {'type': list(dict.fromkeys(kinds))}
    if all(set(schema) == {'enum'} for schema in schemas):
        return {'enum': [each for schema in schemas for each in schema['enum']]}
    return {'anyOf': schemas}


def record_schema(record: type[JsonRecord], parts: dict[str, Schema]) -> Schema:
    """Return the schema of a record."""
    properties, required = keys_of(record, parts)
    return {'type': 'object', 'properties': properties, 'required': required}


def texts() -> dict[Path, str]:
    """Return the content of every file of a schema."""
    found = {}
    for name, record in RECORDS.items():
        parts: dict[str, Schema] = {}
        schema = {'$schema': DIALECT, 'title': (inspect.getdoc(record) or '').partition('\n')[0],
                  **record_schema(record, parts)}
        if parts:
            schema['$defs'] = parts
        found[FOLDER / f'{name}.schema.json'] = json.dumps(
            schema, indent=1, ensure_ascii=False) + '\n'
    return found


if __name__ == '__main__':
    for file, text in texts().items():
        file.write_text(text, encoding='utf-8')
