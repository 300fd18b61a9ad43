"""The simulated plant and the linearizer.

ros2 launch signlin_ros simulation.launch.py params_file:=/path/to/model.yaml input_signal:=square
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """Start `plant_simulator` and `linearizer` on one parameter file."""
    configuration = Path(get_package_share_directory("signlin_ros")) / "config"
    file, namespace = LaunchConfiguration("params_file"), LaunchConfiguration("namespace")
    use_sim_time = {"use_sim_time": LaunchConfiguration("use_sim_time")}
    drive = {
        "input_signal": LaunchConfiguration("input_signal"),
        "amplitude": LaunchConfiguration("amplitude"),
        "input_period": LaunchConfiguration("input_period"),
    }
    return LaunchDescription(
        [
            DeclareLaunchArgument("params_file", default_value=str(configuration / "dc_motor.yaml")),
            DeclareLaunchArgument("namespace", default_value=""),
            DeclareLaunchArgument("use_sim_time", default_value="false"),
            DeclareLaunchArgument("input_signal", default_value="square"),
            DeclareLaunchArgument("amplitude", default_value="2.0"),
            DeclareLaunchArgument("input_period", default_value="6.0"),
            SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", str(configuration / "fastdds_profile.xml")),
            Node(
                package="signlin_ros",
                executable="plant_simulator",
                namespace=namespace,
                parameters=[file, drive, use_sim_time],
                output="screen",
            ),
            Node(
                package="signlin_ros",
                executable="linearizer",
                namespace=namespace,
                parameters=[file, use_sim_time],
                output="screen",
            ),
        ]
    )
