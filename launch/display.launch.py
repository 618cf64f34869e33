# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The robot drawn in RViz or Foxglove as it moves: tf of all links, passive joints too.

    pprs export robot.yaml --to urdf --output robot.urdf
    ros2 launch pprs_dynamics display.launch.py urdf:=robot.urdf model:=/path/robot.yaml
"""

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch.substitutions import Command, LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchContext, LaunchDescription
from pprs_dynamics.system.files import require_files


def generate_launch_description() -> LaunchDescription:
    """Return the nodes and their arguments."""
    arguments = {
        'model': (None, 'model file of the robot that is connected, with a path'),
        'joint_states': ('joint_states', 'topic of the measurements'),
        'namespace': ('', 'of the nodes'),
        'prefix': ('', 'of the joints: joint_states says PREFIXslide_1; empty: joint_prefix of '
                   'the model file'),
        'tf_prefix': ('', 'of all frames: two robots on one /tf need one each'),
        'use_sim_time': ('false', 'the clock is that of /clock'),
        'parameters': ('', 'further file of parameters, e.g. QoS overrides, with a path; empty: '
                       'none'),
    }
    given = {name: LaunchConfiguration(name) for name in ('urdf', *arguments)}

    def monitor(context: LaunchContext) -> list[LifecycleNode]:
        # Launch would leave a missing file out, and say so in a line among many.
        files = require_files(*(given[name].perform(context) for name in ('model', 'parameters')))
        own = {'use_sim_time': given['use_sim_time'],
               'tf_prefix': ParameterValue(given['tf_prefix'], value_type=str)}
        if given['prefix'].perform(context):
            own['joint_prefix'] = ParameterValue(given['prefix'], value_type=str)
        return [LifecycleNode(executable='monitor', name='monitor', package='pprs_dynamics',
                              output='screen',
                     namespace=given['namespace'], parameters=[*files, own],
                     remappings=[('joint_states', given['joint_states'])])]

    actions = [
        DeclareLaunchArgument('urdf', description='file that pprs export has written'),
        *(DeclareLaunchArgument(name, default_value=value, description=text)
          for name, (value, text) in arguments.items()),
        OpaqueFunction(function=monitor)]
    try:
        get_package_prefix('robot_state_publisher')
    except PackageNotFoundError:
        actions.append(LogInfo(msg='robot_state_publisher is not installed: no tf; the joints are '
                               'on monitor/joint_states_full'))
    else:
        description = ParameterValue(Command(['cat "', given['urdf'], '"']), value_type=str)
        actions.append(Node(
            package='robot_state_publisher', executable='robot_state_publisher', output='screen',
            namespace=given['namespace'], parameters=[{
                'robot_description': description, 'use_sim_time': given['use_sim_time'],
                'frame_prefix': ParameterValue(given['tf_prefix'], value_type=str)}],
            remappings=[('joint_states', 'monitor/joint_states_full')]))
    return LaunchDescription(actions)
