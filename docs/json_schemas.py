# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Write JSON schemas and docs/json.md from the dataclasses: python docs/json_schemas.py."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import is_dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

from page_block import replace_block

from pprs_dynamics.app.api.adopt import AdoptionResult, AdoptionRunResult
from pprs_dynamics.app.api.compare import ComparisonResult
from pprs_dynamics.app.api.diagnose import DiagnosisResult
from pprs_dynamics.app.api.fit import FitResult
from pprs_dynamics.app.api.next_experiment import ExperimentResult
from pprs_dynamics.app.api.simulate import SimulationResult
from pprs_dynamics.app.commands.export import ExportJson
from pprs_dynamics.app.commands.history import HistoryJson
from pprs_dynamics.app.commands.info import InfoJson
from pprs_dynamics.app.commands.init import InitJson
from pprs_dynamics.app.commands.reproduce import ReproductionJson
from pprs_dynamics.app.commands.survey import SurveyJson
from pprs_dynamics.app.fleet.trend import FleetTrends
from pprs_dynamics.inference.diagnosis.live_diagnosis import LiveDiagnosis
from pprs_dynamics.ros.node.status import NodeStatus
from pprs_dynamics.system.json_records import JsonRecord

FOLDER = Path(__file__).parents[1] / 'config' / 'schemas'
PAGE = Path(__file__).parent / 'json.md'
BEGIN, END = '<!-- keys: written by docs/json_schemas.py -->', '<!-- end of keys -->'
DIALECT = 'https://json-schema.org/draft/2020-12/schema'
# What writes the JSON: a command, `diagnose --adopt-all` under `adoption`, or a topic of a node.
RECORDS: dict[str, type] = {
    'init': InitJson, 'info': InfoJson, 'fit': FitResult, 'compare': ComparisonResult,
    'diagnose': DiagnosisResult, 'adopt_all': AdoptionRunResult, 'adopt': AdoptionResult,
    'history': HistoryJson, 'next_experiment': ExperimentResult, 'simulate': SimulationResult,
    'export': ExportJson, 'survey': SurveyJson, 'trend': FleetTrends,
    'reproduce': ReproductionJson, 'diagnosis': LiveDiagnosis, 'status': NodeStatus}
HEADINGS = {'adopt_all': '`pprs diagnose --adopt-all`, under `adoption`',
            'diagnosis': '`~/diagnosis`: keys of `pprs diagnose`, and', 'status': '`~/status`'}
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


def is_record(kind: Any) -> bool:
    """Return whether a type has keys of its own."""
    return isinstance(kind, type) and (
        issubclass(kind, JsonRecord) or is_dataclass(kind) or is_typeddict(kind))


def keys_of(record: type, parts: dict[str, Schema]) -> tuple[Schema, list[str]]:
    """Return properties and required keys of a record."""
    if not issubclass(record, JsonRecord):
        names = get_type_hints(record)
        return {name: described_schema(record, name, parts) for name in names}, list(names)
    properties: Schema = {}
    required: list[str] = []
    if record.json_of:
        kind, _ = attribute(record, record.json_of)
        inner = get_args(kind)[1] if get_origin(kind) is Annotated else kind
        properties, required = keys_of(inner, parts)
        required = required if inner is kind else []
    for key in record.own_keys():
        name = dict(record.json_attributes).get(key, key)
        properties[key] = described_schema(record, name, parts)
        required = [each for each in required if each != key]
        required += [key] if key not in record.json_optional else []
    return properties, required


def described_schema(record: type, name: str, parts: dict[str, Schema]) -> Schema:
    """Return the schema of a field or property, with its description."""
    kind, text = attribute(record, name)
    schema = schema_of(kind, parts)
    text = re.sub(r'\b(None|NaN)\b', 'null', ' '.join(text.split()))
    return {**schema, 'description': text} if text else schema


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
    if is_record(kind):
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


def record_schema(record: type, parts: dict[str, Schema]) -> Schema:
    """Return the schema of a record."""
    properties, required = keys_of(record, parts)
    return {'description': (inspect.getdoc(record) or '').partition('\n')[0],
            'type': 'object', 'properties': properties, 'required': required}


def texts() -> dict[Path, str]:
    """Return the content of every file of a schema."""
    found = {}
    for name, record in RECORDS.items():
        parts: dict[str, Schema] = {}
        schema = {'$schema': DIALECT, **record_schema(record, parts)}
        if parts:
            schema['$defs'] = parts
        found[FOLDER / f'{name}.schema.json'] = json.dumps(
            schema, indent=1, ensure_ascii=False) + '\n'
    return found


def section(heading: str, schema: Schema, other: Schema | None = None) -> str:
    """Return description and keys of a schema; without the keys that another schema has, too."""
    known = other['properties'] if other else {}
    described: dict[tuple[str, str], list[str]] = {}
    for key, content in schema['properties'].items():
        if known.get(key) == content:
            continue
        named = re.findall(r"'#/\$defs/(\w+)'", str(content))
        where = ', '.join(f'[{name}](#{name.lower()})' for name in named)
        described.setdefault((content.get('description', ''), where), []).append(f'`{key}`')
    lines = [f'| {", ".join(keys)} | {" ".join(filter(None, (text, where)))} |'
             for (text, where), keys in described.items()]
    return '\n'.join([f'## {heading}', '', schema['description'], '', '| key | content |',
                      '|---|---|', *lines])


def table() -> str:
    """Return a section for each command and node, then one for each record in them, in Markdown."""
    schemas = {name: json.loads(text) for name, text in zip(RECORDS, texts().values(), strict=True)}
    shared = {name: part for schema in schemas.values()
              for name, part in sorted(schema.get('$defs', {}).items())}
    sections = [section(HEADINGS.get(name, f'`pprs {name.replace("_", "-")}`'), schema,
                        schemas['diagnose'] if name == 'diagnosis' else None)
                for name, schema in schemas.items()]
    sections += [section(name, part, shared['FoundEffect'] if name == 'LiveEffect' else None)
                 for name, part in shared.items() if name != 'Adoption']
    return '\n\n'.join(sections).replace('(#adoption)', '(#pprs-adopt)')


if __name__ == '__main__':
    for file, text in texts().items():
        file.write_text(text, encoding='utf-8')
    replace_block(PAGE, BEGIN, END, table())
