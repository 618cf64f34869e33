# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""JSON of results: dataclasses that list their keys, from which docs/json_schemas.py reads too."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any, ClassVar

from pprs_dynamics.system.plain_text import displayed

EMPTY: tuple[Any, ...] = (None, '', (), {})


class JsonRecord:
    """A dataclass that is written as JSON.

    Class attributes
    ----------------
    json_keys : tuple of str
        Each key is the name of a field or property. `key=name` is written under another name than
        it has here, `key?` is left out where it is empty, `**name` adds the keys of another
        record, and `*` or `*?` those of all fields. The default is `*`.
    """

    json_keys: ClassVar[tuple[str, ...]] = ('*',)

    @classmethod
    def json_entries(cls) -> Iterator[tuple[str, str, bool]]:
        """Yield key, name of the attribute, and whether it may be absent."""
        for entry in cls.json_keys:
            if entry in ('*', '*?'):
                names = [each.name for each in fields(cls)]  # type: ignore[arg-type]
                yield from ((name, name, entry.endswith('?')) for name in names)
            else:
                key, _, name = entry.partition('=')
                yield key.rstrip('?'), (name or key).strip('*?'), key.endswith('?')

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        content: dict[str, Any] = {}
        for key, name, may_be_absent in self.json_entries():
            value = getattr(self, name)
            if key.startswith('**'):
                content.update(for_json(value))
            elif not (may_be_absent and value in EMPTY):
                content[key] = for_json(value)
        return content


def for_json(content: Any) -> Any:
    """Return what JSON can hold: text as `displayed`, None for numbers that are not finite.

    Of what has a method `to_dict` the result of that.
    """
    if isinstance(content, JsonRecord):
        return content.to_dict()
    if hasattr(content, 'to_dict'):
        return for_json(content.to_dict())
    if isinstance(content, Mapping):
        return {displayed(key): for_json(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [for_json(value) for value in content]
    if isinstance(content, str):
        return displayed(content)
    if isinstance(content, float) and content - content != 0.0:
        return None
    return content
