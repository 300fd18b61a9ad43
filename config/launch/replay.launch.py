"""A measured record and the linearizer that follows it.

ros2 launch signlin_ros replay.launch.py params_file:=/path/to/emps.yaml record:=/path/to/record.csv rate:=1.0
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

CONFIGURATION = Path(get_package_share_directory("signlin_ros")) / "config"
READ = {"rate": float, "loop": lambda text: text == "true"}
"""Arguments of `replay`, as parameters; one that is not given leaves what the parameter file says."""


def nodes_of(context: LaunchContext) -> list[Node]:
    """Return `replay` and `linearizer` on one parameter file, and on what was given beside it."""

    def told(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    play = {name: read(told(name)) for name, read in READ.items() if told(name)}
    where = {"package": "signlin_ros", "namespace": told("namespace"), "output": "screen"}
    file = told("params_file")
    return [
        Node(**where, executable="replay", parameters=[file, {"record": told("record"), **play}]),
        Node(**where, executable="linearizer", parameters=[file]),
    ]


def generate_launch_description() -> LaunchDescription:
    """Start both."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("params_file", default_value=str(CONFIGURATION / "emps.yaml")),
            DeclareLaunchArgument("namespace", default_value=""),
            DeclareLaunchArgument("record", description="CSV, MAT or rosbag2 to play"),
            *(DeclareLaunchArgument(name, default_value="", description="empty: what the file says") for name in READ),
            SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", str(CONFIGURATION / "fastdds_profile.xml")),
            OpaqueFunction(function=nodes_of),
        ]
    )
