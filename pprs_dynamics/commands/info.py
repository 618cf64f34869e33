"""pprs info: what is in a recording, and what is wrong with it."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from pprs_dynamics.commands.output import write_json
from pprs_dynamics.commands.recordings import add_recordings, read_all
from pprs_dynamics.measurement.recording import describe
from pprs_dynamics.model.model_file import load_model
from pprs_dynamics.report.tables import recording_table
from pprs_dynamics.report.terminal import console, shown


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command takes."""
    add_recordings(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command and return its exit status."""
    screen = console()
    drives = load_model(options.model).drives
    summaries = [describe(recording) for recording in read_all(options, screen, drives)]
    for summary in summaries:
        screen.print(recording_table(summary))
        for finding in summary.findings:
            screen.print(f'[yellow]![/] {shown(finding.text)}')
        if not summary.findings:
            screen.print('[green]nothing wrong found[/]')
    if options.json:
        write_json(options.json, {'recordings': [asdict(summary) for summary in summaries]})
    return 0
