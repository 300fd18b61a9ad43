"""A joint with its linearizer, monitor and controller; include it once for each namespace.

ros2 launch signlin_ros live.launch.py params_file:=/path/to/model.yaml namespace:=joint1 simulate:=false
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, SetEnvironmentVariable
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node


def generate_launch_description() -> LaunchDescription:
    """Start the nodes on one parameter file; what they need is compiled first (`signlin warm`)."""
    configuration = Path(get_package_share_directory("signlin_ros")) / "config"
    file, namespace = LaunchConfiguration("params_file"), LaunchConfiguration("namespace")
    source = {"state_source": LaunchConfiguration("state_source"), "joint_name": LaunchConfiguration("joint_name")}
    common = {"package": "signlin_ros", "namespace": namespace, "output": "screen"}
    managed = [
        LifecycleNode(**common, executable=name, name=name, parameters=[file, source])
        for name in ("linearizer", "monitor")
    ]
    return LaunchDescription(
        [
            DeclareLaunchArgument("params_file", default_value=str(configuration / "dc_motor.yaml")),
            DeclareLaunchArgument("namespace", default_value=""),
            DeclareLaunchArgument("state_source", default_value="joint_state"),
            DeclareLaunchArgument("joint_name", default_value="joint"),
            DeclareLaunchArgument("simulate", default_value="true"),
            DeclareLaunchArgument("controller", default_value="true"),
            SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", str(configuration / "fastdds_profile.xml")),
            ExecuteProcess(cmd=["signlin", "warm", file], output="log"),
            Node(
                **common,
                executable="plant_simulator",
                parameters=[file],
                condition=IfCondition(LaunchConfiguration("simulate")),
            ),
            *managed,
            Node(
                **common,
                executable="controller",
                parameters=[file, source],
                condition=IfCondition(LaunchConfiguration("controller")),
            ),
        ]
    )
