# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The workbench on the running robot: `pprs workbench --live`, its address in the output.

    ros2 launch pprs_dynamics workbench.launch.py model:=/path/robot.yaml
"""

from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackagePrefix

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Return the process and its arguments."""
    pprs = PathJoinSubstitution([FindPackagePrefix('pprs_dynamics'), 'lib/pprs_dynamics/pprs'])
    return LaunchDescription([
        DeclareLaunchArgument(
            'model', description='model file of the robot that is connected, with a path'),
        DeclareLaunchArgument('topic', default_value='joint_states',
                              description='of the measurements'),
        DeclareLaunchArgument('namespace', default_value='/',
                              description='of topic, monitor and feedforward'),
        DeclareLaunchArgument('port', default_value='8080', description='of the workbench'),
        ExecuteProcess(cmd=[pprs, 'workbench', '--live', '--no-browser', '--model',
                            LaunchConfiguration('model'), '--live-topic',
                            LaunchConfiguration('topic'), '--namespace',
                            LaunchConfiguration('namespace'), '--port',
                            LaunchConfiguration('port')], output='screen'),
    ])
