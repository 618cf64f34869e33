# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""`pprs diagnose`: find the physical effect that the model lacks."""

from __future__ import annotations

import argparse
from typing import Any

from pprs_dynamics.app.api.adopt import adopt_all
from pprs_dynamics.app.api.diagnose import DiagnosisResult, diagnose
from pprs_dynamics.app.commands.arguments import (
    add_shared,
    answer,
    require_output,
    show,
    write_json,
)
from pprs_dynamics.app.report.terminal import shown, staged_bar
from pprs_dynamics.system.plain_text import counted

EXAMPLE = 'pprs diagnose run.mcap --model robot.yaml --validate other.mcap --report why.html'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_shared(parser, 'recordings', 'topic', 'as-it-is', 'validate', 'reference', 'report')
    parser.add_argument('--adopt-all', action='store_true', help='add the reported effects')
    add_shared(parser, 'output', required=False, output='model file that --adopt-all writes')


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    require_output(options, 'adopt-all')
    screen, result = answer(diagnose, options, reference=options.reference)
    show(result, options, screen, view=result.view(next_step=not options.adopt_all))
    return _adopt_all(result, options, screen) if options.adopt_all else 0


def _adopt_all(diagnosis: DiagnosisResult, options: argparse.Namespace, screen: Any) -> int:
    """Adopt the reported effects, write the model file, and return the exit status.

    With nothing to adopt the file is written as it was; with a refusal, what was adopted before
    it, if anything.
    """
    inputs = diagnosis.inputs
    with staged_bar(screen) as progress:
        result = adopt_all(inputs.model, inputs, diagnosis=diagnosis, progress=progress,
                           reference=options.reference)
    screen.print(result.view())
    if options.json:
        write_json(options.json, {**diagnosis.to_dict(), 'adoption': result.to_dict()})
    count = len(result.run.adopted)
    if count or not result.refused:
        result.save(options.output)
        screen.print(f'model, {counted(count, "effect")} added: {shown(options.output)}')
    return int(result.refused)
