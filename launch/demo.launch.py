# SPDX-FileCopyrightText: 2026 The pprs_dynamics founders
# SPDX-License-Identifier: Apache-2.0

"""The closed loop without a robot: simulated_robot, feedforward, monitor and a path.

    ros2 launch pprs_dynamics demo.launch.py
    ros2 launch pprs_dynamics demo.launch.py injected_effects:="['stribeck_friction']"
    ros2 launch pprs_dynamics demo.launch.py model:=/path/share/pprs_dynamics/config/hexapod.yaml
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode, Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from launch import LaunchContext, LaunchDescription
from pprs_dynamics.system.files import require_files


def generate_launch_description() -> LaunchDescription:
    """Return the nodes and their arguments."""
    arguments = {
        'model': (PathJoinSubstitution([FindPackageShare('pprs_dynamics'), 'config/paper.yaml']),
                  'model file, with a path'),
        'namespace': ('', 'of the nodes'),
        'rate': ('100.0', 'messages of the path per second'),
        'repeat': ('0', 'how often the path is played; 0: until stopped'),
        'injected_effects': ('[]', 'effects that the simulated robot has and the model lacks'),
        'diagnose_every': ('0.0', 'seconds between diagnoses of the stream; 0: never'),
        'use_sim_time': ('false', 'the clock is that of /clock'),
        'parameters': ('', 'further file of parameters, e.g. QoS overrides, with a path; empty: '
                       'none'),
    }
    given = {name: LaunchConfiguration(name) for name in arguments}

    def nodes(context: LaunchContext) -> list[Node]:
        # Launch would leave a missing file out, and say so in a line among many.
        files = require_files(*(given[name].perform(context) for name in ('model', 'parameters')))
        common = {'package': 'pprs_dynamics', 'namespace': given['namespace'], 'output': 'screen'}
        parameters = [*files, {'use_sim_time': given['use_sim_time']}]
        return [
            Node(executable='simulated_robot', parameters=[*parameters, {
                'injected_effects': ParameterValue(
                    given['injected_effects'], value_type=list[str])}],
                 **common),
            LifecycleNode(executable='feedforward', name='feedforward', parameters=parameters,
                 remappings=[('~/joint_command', 'simulated_robot/joint_command')], **common),
            LifecycleNode(executable='monitor', name='monitor', parameters=[*parameters, {
                'diagnose_every': ParameterValue(given['diagnose_every'], value_type=float)}],
                 **common),
            Node(executable='play_trajectory', parameters=[*parameters, {
                'rate': ParameterValue(given['rate'], value_type=float),
                'repeat': ParameterValue(given['repeat'], value_type=int),
                'source': 'excitation', 'lead_in': 2.0, 'ahead': 0.05}], **common)]

    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=value, description=text)
          for name, (value, text) in arguments.items()), OpaqueFunction(function=nodes)])
