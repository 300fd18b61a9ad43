"""A joint of ros2_control with its linearizer, monitor and controller.

ros2 launch signlin_ros ros2_control.launch.py params_file:=/path/to/model.yaml controllers:=/path/to/controllers.yaml
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

CONFIGURATION = Path(get_package_share_directory("signlin_ros")) / "config"
EXAMPLE = CONFIGURATION / "ros2_control"
COMMANDS = "/drive/commands"
"""What the controller `drive` of the shipped controllers.yaml listens to; all that call it ``input`` are put there."""


def nodes_of(context: LaunchContext) -> list[Node]:
    """Return the controller manager with its controllers, and the nodes that watch and drive the joint."""

    def told(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    text = {"robot_description": Path(told("robot")).read_text(encoding="utf-8")}
    names = ("joint_state_broadcaster", "drive")
    manager = [
        Node(package="robot_state_publisher", executable="robot_state_publisher", parameters=[text]),
        Node(package="controller_manager", executable="ros2_control_node", parameters=[told("controllers")]),
        *(Node(package="controller_manager", executable="spawner", arguments=[name]) for name in names),
    ]
    where = {"package": "signlin_ros", "parameters": [told("params_file")], "output": "screen"}
    remapped = [("input", told("commands"))]
    wanted = ("linearizer", "monitor", "controller")
    own = [Node(**where, executable=name, remappings=remapped) for name in wanted]
    return [*(manager if told("manager").lower() in ("true", "1") else []), *own]


def generate_launch_description() -> LaunchDescription:
    """Start all; ``manager:=false`` where a controller manager is running already."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("params_file", default_value=str(EXAMPLE / "wheel.yaml")),
            DeclareLaunchArgument("controllers", default_value=str(EXAMPLE / "controllers.yaml")),
            DeclareLaunchArgument("robot", default_value=str(EXAMPLE / "wheel.urdf")),
            DeclareLaunchArgument("commands", default_value=COMMANDS, description="topic of the effort's controller"),
            DeclareLaunchArgument("manager", default_value="true", description="whether ros2_control is started, too"),
            SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", str(CONFIGURATION / "fastdds_profile.xml")),
            OpaqueFunction(function=nodes_of),
        ]
    )
