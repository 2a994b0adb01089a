"""The node graph on a full ROS 2.

ros2 launch mine_loc_bringup mine_loc.launch.py site:=/path/to/site [sim_time:=true]
"""

import sys
from pathlib import Path

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription
from mine_loc_bringup.graph import expand, node_environment
from mine_loc_bringup.supervisor import FIRST_DELAY_S
from mine_loc_core.people import load_people
from mine_loc_core.site import load_site


def start_nodes(context: LaunchContext) -> list[Node]:
    """One action for each node of the graph."""
    folder = Path(LaunchConfiguration("site").perform(context))
    use_sim_time = LaunchConfiguration("sim_time").perform(context).lower() == "true"
    site = load_site(folder)
    return [
        Node(
            executable=sys.executable,
            arguments=["-m", node.module],
            name=node.node_name,
            namespace=node.namespace,
            parameters=[*([str(node.parameter_file)] if node.parameter_file else []), dict(node.parameters)],
            additional_env=node_environment(site.discovery),
            output="screen",
            respawn=True,
            respawn_delay=FIRST_DELAY_S,
        )
        for node in expand(site, load_people(folder), folder, use_sim_time=use_sim_time)
    ]


def generate_launch_description() -> LaunchDescription:
    """What ros2 launch asks for."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("site", description="folder of site.yaml and people.yaml"),
            DeclareLaunchArgument("sim_time", default_value="false", description="use the time of /clock"),
            OpaqueFunction(function=start_nodes),
        ]
    )
