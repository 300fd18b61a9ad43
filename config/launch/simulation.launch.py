"""The simulated plant and the linearizer.

ros2 launch signlin_ros simulation.launch.py params_file:=/path/to/model.yaml input_signal:=square
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

CONFIGURATION = Path(get_package_share_directory("signlin_ros")) / "config"
DEFAULTS = {"input_signal": "square", "amplitude": 2.0, "input_period": 6.0}
"""How the plant is driven where neither the parameter file nor an argument says otherwise."""


def nodes_of(context: LaunchContext) -> list[Node]:
    """Return `plant_simulator` and `linearizer` on one parameter file, and on what was given beside it."""

    def told(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    drive = [{name: type(value)(told(name))} for name, value in DEFAULTS.items() if told(name)]
    clock = [{"use_sim_time": told("use_sim_time") == "true"}] if told("use_sim_time") else []
    where = {"package": "signlin_ros", "namespace": told("namespace"), "output": "screen"}
    file = told("params_file")
    return [
        Node(**where, executable="plant_simulator", parameters=[DEFAULTS, file, *drive, *clock]),
        Node(**where, executable="linearizer", parameters=[file, *clock]),
    ]


def generate_launch_description() -> LaunchDescription:
    """Start both; an argument that is empty leaves what the parameter file says."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("params_file", default_value=str(CONFIGURATION / "dc_motor.yaml")),
            DeclareLaunchArgument("namespace", default_value=""),
            DeclareLaunchArgument("use_sim_time", default_value=""),
            *(
                DeclareLaunchArgument(name, default_value="", description=f"empty: what the file says, else {value}")
                for name, value in DEFAULTS.items()
            ),
            SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", str(CONFIGURATION / "fastdds_profile.xml")),
            OpaqueFunction(function=nodes_of),
        ]
    )
