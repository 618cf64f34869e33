# Copyright 2026 The pprs_dynamics founders
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The terminal as rich sees it, in characters that the terminal has."""

from __future__ import annotations

from typing import Any

from pprs_dynamics.errors import MissingLibraryError
from pprs_dynamics.plain_text import PLAIN, displayed


def console() -> Any:
    """Return rich's console, or raise MissingLibraryError."""
    try:
        from rich.console import Console
    except ImportError:
        raise MissingLibraryError('rich', 'showing tables', 'report') from None

    class PlainConsole(Console):
        """Puts plain characters in place before widths are counted, so that tables stay even."""

        def render_str(self, text: str, *args: Any, **options: Any) -> Any:
            plain = text.encode(self.encoding, PLAIN).decode(self.encoding)
            return super().render_str(plain, *args, **options)

    # A name such as a:bug:.csv is no picture.
    return PlainConsole(emoji=False)


def shown(name: object) -> str:
    """Return a name, or other text from data, for a line that may hold rich's markup."""
    from rich.markup import escape

    return escape(displayed(name))
