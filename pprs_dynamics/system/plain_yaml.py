# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Values in one line of YAML: names as they are, and quoted where they would be something else."""

from __future__ import annotations

import math
import re
from typing import Any

import yaml

PLAIN = re.compile(r'(\.{0,2}/|[A-Za-z_])[\w./\-]*', re.ASCII)
NUMBERS = {'y', 'n', 'nan', 'inf'}  # what ROS 2 takes for no word; the rest YAML 1.1 quotes


class _Scalars(yaml.SafeDumper):
    """Writer of values as ROS 2 and YAML 1.1 read them alike."""

    def represent_word(self, word: str) -> yaml.Node:
        """Return a word, quoted where ROS 2 might take it for a number or for true or false."""
        is_plain = PLAIN.fullmatch(word) and word.lower() not in NUMBERS
        return self.represent_scalar('tag:yaml.org,2002:str', word, style=None if is_plain else '"')


_Scalars.add_representer(str, _Scalars.represent_word)
_Scalars.add_multi_representer(float, lambda to, number: to.represent_float(float(number)))


def as_yaml(value: Any) -> str:
    """Return a value of a model file in one line."""
    text: str = yaml.dump(value, Dumper=_Scalars, default_flow_style=True, sort_keys=False,
                          width=math.inf, allow_unicode=True)
    return text.removesuffix('\n').removesuffix('\n...')
