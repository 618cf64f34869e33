# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The site of the documentation: `make docs` writes it into build/docs/html."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxTranslator

DOCS = Path(__file__).parent
sys.path[:0] = [str(DOCS), str(DOCS.parent)]

import pprs_dynamics  # noqa: E402

# rosdoc2 builds a copy of this folder that stands elsewhere.
PROJECT = Path(pprs_dynamics.__file__).parents[1]
sys.path.insert(0, str(PROJECT / 'test' / 'support'))

import api_pages  # noqa: E402
import effect_pages  # noqa: E402

project = 'pprs_dynamics'
author = 'The pprs_dynamics founders'
copyright = f'2026 {author}'
version = release = pprs_dynamics.__version__

extensions = ['myst_nb', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon']
exclude_patterns = ['example_effect/*.egg-info']
html_theme = 'furo'
html_title = f'pprs_dynamics {version}'
html_static_path: list[str] = []
# What rosdoc2 would load beside: myst_nb reads Markdown already.
rosdoc2_settings = {'support_markdown': False, 'override_theme': False}

# Headings get the anchors that a reader of the repository's pages sees, too.
myst_heading_anchors = 3
myst_enable_extensions = ['dollarmath']
# Equations are part of the page: MathJax, the default, is fetched from a network.
html_math_renderer = 'mathml'
# Notebooks are run by tests; the site shows what is in the file.
nb_execution_mode = 'off'

napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_custom_sections = [('Class attributes', 'params_style'), 'Equation', 'Symptom',
                            'Causes', 'Confirmation']
autodoc_member_order = 'bysource'
autodoc_typehints = 'description'
autodoc_typehints_description_target = 'documented'
autodoc_default_options = {'members': True, 'show-inheritance': True}
# Some names stand in two modules; a link then leads to the first.
suppress_warnings = ['ref.python']
# ROS 2 need not be there: the nodes are read without it.
autodoc_mock_imports = sorted({
    name for file in (PROJECT / 'pprs_dynamics' / 'ros').rglob('*.py')
    for name in re.findall(r'^ *(?:from|import) (rclpy|\w+_msgs|\w+_interfaces)\b',
                           file.read_text(encoding='utf-8'), re.M)})


def write_generated_pages(app: Sphinx) -> None:
    """Write the pages of the API and of the effects below docs/generated, which git ignores."""
    folder = DOCS / 'generated'
    api_pages.write(folder / 'api')
    effect_pages.write(folder / 'effects')
    shutil.copytree(PROJECT / 'benchmarks' / 'results', folder / 'results', dirs_exist_ok=True)


def link_results(app: Sphinx, name: str, source: list[str]) -> None:
    """Let links to the results of benchmarks lead to their copies on the site."""
    source[0] = source[0].replace('../benchmarks/results/', 'generated/results/')


def escape_marks(app: Sphinx, what: str, name: str, thing: object, options: object,
                 lines: list[str]) -> None:
    """Keep |v| and *arguments of docstrings from being read as marks of reStructuredText."""
    lines[:] = [re.sub(r'(?<![*\\])\*(?=\w)', r'\*', line.replace('|', r'\|')) for line in lines]


def write_equation(translator: SphinxTranslator, node: nodes.Element) -> None:
    """Write an equation as MathML, which browsers draw themselves."""
    is_block = isinstance(node, nodes.math_block)
    translator.body.append(tex2mathml(node.astext(), as_block=is_block))
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Let Sphinx write the generated pages before it looks for sources."""
    app.add_html_math_renderer('mathml', (write_equation, None), (write_equation, None))
    app.connect('builder-inited', write_generated_pages)
    app.connect('source-read', link_results)
    # Before napoleon, which makes marks of its own.
    app.connect('autodoc-process-docstring', escape_marks, priority=400)
