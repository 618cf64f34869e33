# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Layouts for PlotJuggler and Foxglove: as those tools read them, and as the files hold them."""

from __future__ import annotations

import json
from typing import Any
from xml.etree import ElementTree

from pprs_dynamics.app.report.layouts import foxglove_layout, plotjuggler_layout
from pprs_dynamics.drives import DRIVES


def test_plotjuggler_finds_what_it_looks_for() -> None:
    """The elements and attributes that PlotJuggler 3's loaders ask for, on every level."""
    root = ElementTree.fromstring(plotjuggler_layout(('a', 'b')))
    assert root.tag == 'root'
    (window,) = root.findall('tabbed_widget')
    assert (window.get('name'), window.get('parent')) == ('Main Window', 'main_window')
    for tab in window.findall('Tab'):
        containers = tab.findall('Container')
        assert int(tab.get('containers', '')) == len(containers) == 1
        (splitter,) = containers[0].findall('DockSplitter')
        assert splitter.get('orientation') in ('|', '-')
        areas = splitter.findall('DockArea')
        sizes = [float(size) for size in splitter.get('sizes', '').split(';')]
        assert int(splitter.get('count', '')) == len(areas) == len(sizes) == 2
        for area, drive in zip(areas, 'ab', strict=True):
            (plot,) = area.findall('plot')
            assert plot.get('mode') == 'TimeSeries'
            assert all(curve.get('name', '').endswith(f'/{drive}/effort')
                       for curve in plot.findall('curve'))


def test_every_panel_of_foxglove_is_on_the_screen_once() -> None:
    layout = json.loads(foxglove_layout(DRIVES))

    def shown(node: Any) -> list[str]:
        return [node] if isinstance(node, str) else shown(node['first']) + shown(node['second'])

    assert sorted(shown(layout['layout'])) == sorted(layout['configById'])
    paths = [path['value'] for panel in layout['configById'].values() for path in panel['paths']]
    assert len(set(paths)) == 3 * len(DRIVES)
