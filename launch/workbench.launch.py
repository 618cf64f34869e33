# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The workbench on the running robot: `pprs workbench --live`, its address in the output.

    ros2 launch pprs_dynamics workbench.launch.py model:=/path/robot.yaml
"""

from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackagePrefix

from launch import LaunchContext, LaunchDescription
from pprs_dynamics.system.files import require_files


def generate_launch_description() -> LaunchDescription:
    """Return the process and its arguments."""
    arguments = {
        'model': (None, 'model file of the robot that is connected, with a path'),
        'namespace': ('', 'of the topic, monitor and feedforward'),
        'prefix': ('', 'of the joints: joint_states says PREFIXslide_1; empty: joint_prefix of '
                   'the model file'),
        'joint_states': ('joint_states', 'topic of the measurements'),
        'port': ('8080', 'of the workbench'),
        'use_sim_time': ('false', 'the clock is that of /clock'),
        'parameters': ('', 'further file of parameters, e.g. QoS overrides, with a path; empty: '
                       'none'),
    }
    given = {name: LaunchConfiguration(name) for name in arguments}

    def process(context: LaunchContext) -> list[ExecuteProcess]:
        # Launch would leave a missing file out, and say so in a line among many.
        model, *files = require_files(
            *(given[name].perform(context) for name in ('model', 'parameters')))
        pprs = PathJoinSubstitution([FindPackagePrefix('pprs_dynamics'), 'lib/pprs_dynamics/pprs'])
        return [ExecuteProcess(cmd=[
            pprs, 'workbench', '--live', '--no-browser', '--model', model,
            '--live-topic', given['joint_states'], '--port', given['port'],
            '--ros-args', '-r', f'__ns:=/{given["namespace"].perform(context).strip("/")}',
            '-p', ['use_sim_time:=', given['use_sim_time']],
            *(('-p', ['joint_prefix:=', given['prefix']])
              if given['prefix'].perform(context) else ()),
            *(word for file in files for word in ('--params-file', file))], output='screen')]

    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=value, description=text)
          for name, (value, text) in arguments.items()), OpaqueFunction(function=process)])
