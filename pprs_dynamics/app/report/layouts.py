# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Layouts for PlotJuggler and Foxglove of what `pprs compare --mcap` writes, drive by drive.

PlotJuggler names the values of a sensor_msgs/JointState TOPIC/JOINT/effort, and its layouts are
XML (PlotJuggler 3: `TabbedPlotWidget::xmlLoadState`, `PlotWidget::xmlLoadState`). Foxglove's
message paths index arrays: TOPIC.effort[0].
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree

from pprs_dynamics.inference.residuals.comparison_bag import MEASURED, MODEL, RESIDUAL

COLOURS = {MEASURED: '#1f77b4', MODEL: '#ff7f0e', RESIDUAL: '#d62728'}
FORCES = 'measured and model'


def plotjuggler_layout(drives: Sequence[str]) -> str:
    """Return a layout with one tab for efforts and one for residuals, one plot a drive."""
    root = ElementTree.Element('root')
    window = ElementTree.SubElement(
        root, 'tabbed_widget', {'name': 'Main Window', 'parent': 'main_window'})
    for name, topics in ((FORCES, (MEASURED, MODEL)), ('residual', (RESIDUAL,))):
        tab = ElementTree.SubElement(window, 'Tab', tab_name=name, containers='1')
        share = ';'.join([f'{1 / len(drives):.6f}'] * len(drives))
        splitter = ElementTree.SubElement(
            ElementTree.SubElement(tab, 'Container'), 'DockSplitter', orientation='-',
            count=str(len(drives)), sizes=share)
        for drive in drives:
            plot = ElementTree.SubElement(
                ElementTree.SubElement(splitter, 'DockArea', name=drive), 'plot',
                mode='TimeSeries', style='Lines', line_width='1.0', flip_x='false', flip_y='false')
            for topic in topics:
                ElementTree.SubElement(plot, 'curve', name=f'{topic}/{drive}/effort',
                                       color=COLOURS[topic])
    ElementTree.SubElement(window, 'currentTabIndex', index='0')
    ElementTree.SubElement(root, 'use_relative_time_offset', enabled='1')
    ElementTree.indent(root, ' ')
    return ElementTree.tostring(root, encoding='unicode', xml_declaration=True) + '\n'


def foxglove_layout(drives: Sequence[str]) -> str:
    """Return a layout with a plot of measured, model and residual for each drive."""
    panels = {}
    for index, drive in enumerate(drives):
        panels[f'Plot!pprs{index}'] = {
            'foxglovePanelTitle': drive, 'showLegend': True, 'legendDisplay': 'floating',
            'isSynced': True, 'xAxisVal': 'timestamp', 'showXAxisLabels': True,
            'showYAxisLabels': True,
            'paths': [{'value': f'{topic}.effort[{index}]', 'enabled': True,
                       'timestampMethod': 'headerStamp', 'label': topic.strip('/'),
                       'color': colour} for topic, colour in COLOURS.items()]}
    return json.dumps({
        'configById': panels, 'globalVariables': {}, 'userNodes': {},
        'playbackConfig': {'speed': 1}, 'layout': _stacked(list(panels))}, indent=1) + '\n'


def _stacked(panels: list[str]) -> Any:
    """Return panels over each other, all of one height."""
    if len(panels) == 1:
        return panels[0]
    return {'direction': 'column', 'first': panels[0], 'second': _stacked(panels[1:]),
            'splitPercentage': round(100 / len(panels), 3)}
