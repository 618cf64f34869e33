# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The main job, shown: two nodes over DDS, the paper's path in, six drive forces out.

`feedforward` and `play_trajectory` run as processes of their own; this script only listens.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table
from ros_processes import executable, node_process, reserve_domain

from pprs_dynamics.app.report.pictures import BLUE, GREEN, ORANGE, SKY, new_figure, save
from pprs_dynamics.drives import DRIVES

PARTS = ('rigid_body', 'active_friction', 'passive_friction')
RATE = 200.0
MESSAGES = 944  # 3 pi / 2 seconds of path, both ends included
PATIENCE = 30.0  # [s] for discovery and the path together
SETTLE = 1.0  # [s]
ROWS = 16


def main() -> int:
    """Run the demonstration and return its exit status."""
    output = Path(sys.argv[1] if len(sys.argv) > 1 else 'output')
    output.mkdir(parents=True, exist_ok=True)
    console = Console()
    if not console.is_terminal and 'COLUMNS' not in os.environ:
        console = Console(width=100)
    domain, holder = reserve_domain()
    with holder, tempfile.TemporaryDirectory() as folder:
        log = Path(folder)
        console.print('Starting [b]feedforward[/] and [b]play_trajectory[/] as two processes; '
                      f"the paper's helical path at {RATE:g} Hz goes in ...")
        # Without a model file it is the paper's robot. Every message is answered, however late:
        # this is a drawing of forces, and no machine hangs on it.
        command = [executable('feedforward'), '--ros-args', '-p', 'demo:=true',
                   '-p', 'max_age:=0.0', '-p',
                   'qos_overrides./feedforward/trajectory.subscription.depth:=1000']
        with node_process(command, domain, log / 'feedforward.log'):
            time_s, total, parts = _listen(domain, log, console)
        if len(time_s) < MESSAGES:
            console.print(f'[red]only {len(time_s)} of {MESSAGES} messages were answered[/]')
            for file in sorted(log.iterdir()):
                console.print(f'{file.name}:\n{file.read_text()}')
            return 1
    console.print(_table(time_s, total, parts))
    console.print(f'{len(time_s)} messages in, {len(total)} commands out, all finite: '
                  f'{bool(np.isfinite(total).all())}')
    picture = draw_forces(output / 'drive_forces.png', time_s, total, parts,
                          "Drive forces on the paper's helical path, as published by feedforward")
    curves = output / 'drive_forces.csv'
    np.savetxt(curves, np.column_stack((time_s, total)), delimiter=',', fmt='%.9g', comments='',
               header=','.join(('time', *(f'{drive}/effort' for drive in DRIVES))))
    console.print(f'Picture: [b]{picture}[/]   curves: [b]{curves}[/]')
    return 0


def _listen(
    domain: int, log: Path, console: Console,
) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Play the path and return what came out: times, forces and their parts."""
    os.environ.update(ROS_DOMAIN_ID=str(domain), ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from sensor_msgs.msg import JointState

    rclpy.init()
    node = rclpy.create_node('demo')
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    received: dict[str, dict[int, list[float]]] = {name: {} for name in ('total', *PARTS)}

    def keep(name: str, message: JointState) -> None:
        stamp = message.header.stamp
        received[name][stamp.sec * 10 ** 9 + stamp.nanosec] = list(message.effort)

    topics = {'total': '/feedforward/joint_command',
              **{part: f'/feedforward/effort/{part}' for part in PARTS}}
    subscriptions = [node.create_subscription(
        JointState, topic, lambda message, name=name: keep(name, message), 1000)
        for name, topic in topics.items()]
    deadline = time.monotonic() + PATIENCE
    while (not all(subscription.get_publisher_count() for subscription in subscriptions)
           and time.monotonic() < deadline):
        executor.spin_once(timeout_sec=0.05)
    # Discovery is one-sided: the node may see us a moment after we see it.
    time.sleep(SETTLE)
    command = [executable('play_trajectory'), '--ros-args', '-p', f'rate:={RATE}']
    with (node_process(command, domain, log / 'play_trajectory.log'),
          Progress(console=console, transient=True) as progress):
        task = progress.add_task('commands received', total=MESSAGES)
        while (min(len(kept) for kept in received.values()) < MESSAGES
               and time.monotonic() < deadline):
            executor.spin_once(timeout_sec=0.05)
            progress.update(task, completed=len(received['total']))
    subscriptions.clear()
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown()
    stamps = sorted(set.intersection(*(set(kept) for kept in received.values())))
    # The path starts with the first message; stamps are the moments of publication.
    time_s = (np.array(stamps, dtype=float) - stamps[0]) / 1e9 if stamps else np.empty(0)
    arrays = {name: np.array([kept[stamp] for stamp in stamps]).reshape(-1, 6)
              for name, kept in received.items()}
    return time_s, arrays.pop('total'), arrays


def _table(time_s: np.ndarray, total: np.ndarray, parts: dict[str, np.ndarray]) -> Table:
    friction = parts['active_friction'] + parts['passive_friction']
    table = Table(title='Drive forces [N], and how much of each is friction')
    table.add_column('time [s]', justify='right')
    for drive in DRIVES:
        table.add_column(drive, justify='right')
    for row in np.linspace(0, len(time_s) - 1, ROWS).astype(int):
        table.add_row(f'{time_s[row]:.2f}', *(
            f'{force:6.2f} [dim]{share:4.0%}[/]' for force, share in zip(
                total[row], _share(friction[row], total[row]), strict=True)))
    table.add_section()
    rms = np.sqrt(np.mean(total ** 2, axis=0))
    share = np.sqrt(np.mean(friction ** 2, axis=0)) / rms
    table.add_row('rms', *(f'[b]{force:6.2f} {part:4.0%}[/]'
                           for force, part in zip(rms, share, strict=True)))
    return table


def _share(friction: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Return how much of the two parts' sizes is friction, 0 to 1, also where they cancel."""
    sizes = np.abs(friction) + np.abs(total - friction)
    return np.abs(friction) / np.maximum(sizes, 1e-12)


def draw_forces(path: Path, time: np.ndarray, total: np.ndarray, parts: dict[str, np.ndarray],
                title: str) -> Path:
    """Draw the six drive forces over time, with and without friction, and the friction below.

    Parameters
    ----------
    path : path
        PNG file to write.
    time : (N,) array
        [s].
    total : (N, 6) array
        Drive forces [N].
    parts : mapping of (N, 6) arrays
        `rigid_body`, `active_friction`, `passive_friction` [N].
    title : str
    """
    figure = new_figure(12, 8.5)
    axes = figure.subplots(4, 3, sharex=True, height_ratios=(2, 1, 2, 1))
    for drive, name in enumerate(DRIVES):
        row, column = 2 * (drive // 3), drive % 3
        upper, lower = axes[row, column], axes[row + 1, column]
        upper.plot(time, parts['rigid_body'][:, drive], color=SKY, lw=1.5, label='rigid body alone')
        upper.plot(time, total[:, drive], color=BLUE, lw=1.5, label='with friction: the command')
        lower.plot(time, parts['active_friction'][:, drive], color=ORANGE, lw=1.2,
                   label='friction of the drives')
        lower.plot(time, parts['passive_friction'][:, drive], color=GREEN, lw=1.2,
                   label='friction of the passive joints')
        upper.set_title(name, loc='left', fontsize=10, fontweight='bold')
        for axis in (upper, lower):
            axis.grid(alpha=0.25)
            axis.spines[['top', 'right']].set_visible(False)
        if column == 0:
            upper.set_ylabel('force [N]')
            lower.set_ylabel('friction [N]')
    for axis in axes[3]:
        axis.set_xlabel('time [s]')
    handles = [*axes[0, 0].get_lines(), *axes[1, 0].get_lines()]
    figure.suptitle(title)
    figure.legend(handles=handles, loc='outside lower center', ncols=4, frameon=False)
    return save(figure, path)


if __name__ == '__main__':
    sys.exit(main())
