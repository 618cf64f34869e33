# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The monitor alone: measured efforts against the model, and what changes on the machine.

    ros2 launch pprs_dynamics monitor.launch.py model:=/path/robot.yaml diagnose_every:=60.0
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchContext, LaunchDescription
from pprs_dynamics.system.files import require_files


def generate_launch_description() -> LaunchDescription:
    """Return the node and its arguments."""
    arguments = {
        'model': (None, 'model file of the robot that is connected, with a path'),
        'namespace': ('', 'of the node'),
        'prefix': ('', 'of the joints: joint_states says PREFIXslide_1; empty: joint_prefix of '
                   'the model file'),
        'joint_states': ('joint_states', 'topic of the measurements'),
        'diagnose_every': ('', 'seconds between diagnoses of the stream, 0: never; empty: as in '
                           'the model file'),
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
        if given['diagnose_every'].perform(context):
            own['diagnose_every'] = ParameterValue(given['diagnose_every'], value_type=float)
        return [LifecycleNode(executable='monitor', name='monitor', package='pprs_dynamics',
                              namespace=given['namespace'],
                     parameters=[*files, own], output='screen',
                     remappings=[('joint_states', given['joint_states'])])]

    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=value, description=text)
          for name, (value, text) in arguments.items()), OpaqueFunction(function=nodes)])
