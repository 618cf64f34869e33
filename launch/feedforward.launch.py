# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""Feedforward with a controller of ros2_control, and optionally its monitor.

    ros2 launch pprs_dynamics feedforward.launch.py model:=/path/robot.yaml \
      controller:=joint_trajectory_controller
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchContext, LaunchDescription
from pprs_dynamics.system.files import require_files


def generate_launch_description() -> LaunchDescription:
    """Return the nodes and their arguments."""
    arguments = {
        'model': (None, 'model file of the robot that is connected, with a path'),
        'namespace': ('', 'of the nodes'),
        'prefix': ('', 'of the joints: joint_states and controllers say PREFIXslide_1; empty: '
                   'joint_prefix of the model file'),
        'controller': ('forward_command_controller', 'that gets ~/commands and ~/joint_trajectory'),
        'stop_time': ('0.1', 'seconds in which a controller of trajectories comes to rest if '
                      'nothing follows; 0.0: it goes on at the last speed'),
        'monitor': ('true', 'compare joint_states with the model, too'),
        'joint_states': ('joint_states', 'topic of the measurements'),
        'use_sim_time': ('false', 'the clock is that of /clock'),
        'parameters': ('', 'further file of parameters, e.g. QoS overrides, with a path; empty: '
                       'none'),
    }
    given = {name: LaunchConfiguration(name) for name in arguments}

    def nodes(context: LaunchContext) -> list[LifecycleNode]:
        # Launch would leave a missing file out, and say so in a line among many.
        files = require_files(*(given[name].perform(context) for name in ('model', 'parameters')))
        own = {'use_sim_time': given['use_sim_time']}
        if given['prefix'].perform(context):
            own['joint_prefix'] = ParameterValue(given['prefix'], value_type=str)
        parameters = [*files, own]
        return [
            LifecycleNode(executable='feedforward', name='feedforward', package='pprs_dynamics',
                          namespace=given['namespace'],
                 parameters=[*parameters, {
                     'stop_time': ParameterValue(given['stop_time'], value_type=float)}],
                 output='screen', remappings=[
                     ('~/commands', [given['controller'], '/commands']),
                     ('~/joint_trajectory', [given['controller'], '/joint_trajectory'])]),
            LifecycleNode(executable='monitor', name='monitor', package='pprs_dynamics',
                          namespace=given['namespace'],
                 parameters=parameters, output='screen', condition=IfCondition(given['monitor']),
                 remappings=[('joint_states', given['joint_states'])])]

    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=value, description=text)
          for name, (value, text) in arguments.items()), OpaqueFunction(function=nodes)])
