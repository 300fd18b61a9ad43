"""A measured record and the linearizer that follows it.

ros2 launch signlin_ros replay.launch.py params_file:=/path/to/emps.yaml record:=/path/to/record.csv rate:=1.0
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """Start `replay` and `linearizer` on one parameter file."""
    configuration = Path(get_package_share_directory("signlin_ros")) / "config"
    file, namespace = LaunchConfiguration("params_file"), LaunchConfiguration("namespace")
    play = {name: LaunchConfiguration(name) for name in ("record", "rate", "loop")}
    return LaunchDescription(
        [
            DeclareLaunchArgument("params_file", default_value=str(configuration / "emps.yaml")),
            DeclareLaunchArgument("namespace", default_value=""),
            DeclareLaunchArgument("record", description="CSV, MAT or rosbag2 to play"),
            DeclareLaunchArgument("rate", default_value="1.0"),
            DeclareLaunchArgument("loop", default_value="false"),
            SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", str(configuration / "fastdds_profile.xml")),
            Node(
                package="signlin_ros",
                executable="replay",
                namespace=namespace,
                parameters=[file, play],
                output="screen",
            ),
            Node(
                package="signlin_ros",
                executable="linearizer",
                namespace=namespace,
                parameters=[file],
                output="screen",
            ),
        ]
    )
