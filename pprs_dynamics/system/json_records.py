# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""JSON of results: dataclasses that list their keys, from which docs/json_schemas.py reads too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar

from pprs_dynamics.system.plain_text import displayed

EMPTY: tuple[Any, ...] = (None, '', (), {})


class JsonRecord:
    """A dataclass whose JSON has other keys than its fields.

    Class attributes
    ----------------
    json_keys : tuple of str
        Keys, each the name of a field or property; none given: all fields.
    json_attributes : tuple of (str, str)
        Keys whose field or property has another name, and that name.
    json_optional : tuple of str
        Keys that are left out where they are empty.
    json_of : str
        Field or property whose keys come first; '' for none. Without `json_keys` it is all.
    """

    json_keys: ClassVar[tuple[str, ...]] = ()
    json_attributes: ClassVar[tuple[tuple[str, str], ...]] = ()
    json_optional: ClassVar[tuple[str, ...]] = ()
    json_of: ClassVar[str] = ''

    @classmethod
    def own_keys(cls) -> tuple[str, ...]:
        """Return the keys of the JSON without those of `json_of`."""
        if cls.json_keys or cls.json_of:
            return cls.json_keys
        return tuple(field.name for field in fields(cls))  # type: ignore[arg-type]

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        content = dict(for_json(getattr(self, self.json_of))) if self.json_of else {}
        for key in self.own_keys():
            value = getattr(self, dict(self.json_attributes).get(key, key))
            if key not in self.json_optional or value not in EMPTY:
                content[key] = for_json(value)
        return content


def for_json(content: Any) -> Any:
    """Return a value for JSON: text as `displayed`, None for numbers that are not finite.

    Objects with a method `to_dict` and dataclasses become dictionaries.
    """
    if hasattr(content, 'to_dict'):
        return content.to_dict() if isinstance(content, JsonRecord) else for_json(content.to_dict())
    if is_dataclass(content):
        return {field.name: for_json(getattr(content, field.name)) for field in fields(content)}
    if isinstance(content, Mapping):
        return {displayed(key): for_json(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [for_json(value) for value in content]
    if isinstance(content, str):
        return displayed(content)
    if isinstance(content, float) and content - content != 0.0:
        return None
    return content
