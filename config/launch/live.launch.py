"""A joint with its linearizer, monitor and controller; include it once for each namespace.

ros2 launch signlin_ros live.launch.py params_file:=/path/to/model.yaml limit:=12.0 namespace:=joint1 simulate:=false
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, LogInfo, OpaqueFunction, SetEnvironmentVariable
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node

SHIPPED = Path(get_package_share_directory("signlin_ros")) / "config" / "dc_motor.yaml"
SHIPPED_LIMIT = 12.0
"""Largest |voltage| in V of the shipped motor; of any other drive only its owner knows the limit."""
NO_LIMIT = "no controller: give limit:=..., the largest |input| that the drive may be given (or controller:=false)"


def controller_of(context: LaunchContext) -> list[Node | LogInfo]:
    """Return the controller with the limit that was given; without one, a line that says so, and the rest goes on."""
    file, limit, namespace, source, joint = (
        LaunchConfiguration(name).perform(context)
        for name in ("params_file", "limit", "namespace", "state_source", "joint_name")
    )
    most = float(limit) if limit else SHIPPED_LIMIT if Path(file) == SHIPPED else 0.0
    if not most > 0.0:
        return [LogInfo(msg=NO_LIMIT)]
    options = {"limit": most, "state_source": source, "joint_name": joint}
    where = {"package": "signlin_ros", "namespace": namespace, "output": "screen"}
    return [Node(**where, executable="controller", parameters=[file, options])]


def generate_launch_description() -> LaunchDescription:
    """Start the nodes on one parameter file; what they need is compiled first (`signlin warm`)."""
    file, namespace = LaunchConfiguration("params_file"), LaunchConfiguration("namespace")
    source = {"state_source": LaunchConfiguration("state_source"), "joint_name": LaunchConfiguration("joint_name")}
    common = {"package": "signlin_ros", "namespace": namespace, "output": "screen"}
    managed = [
        LifecycleNode(**common, executable=name, name=name, parameters=[file, source])
        for name in ("linearizer", "monitor")
    ]
    profile = str(SHIPPED.parent / "fastdds_profile.xml")
    return LaunchDescription(
        [
            DeclareLaunchArgument("params_file", default_value=str(SHIPPED)),
            DeclareLaunchArgument("namespace", default_value=""),
            DeclareLaunchArgument("state_source", default_value="joint_state"),
            DeclareLaunchArgument("joint_name", default_value="joint"),
            DeclareLaunchArgument("simulate", default_value="true"),
            DeclareLaunchArgument("controller", default_value="true"),
            DeclareLaunchArgument("limit", default_value="", description="largest |input| of the controller"),
            SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", profile),
            ExecuteProcess(cmd=["signlin", "warm", file], output="log"),
            Node(
                **common,
                executable="plant_simulator",
                parameters=[file],
                condition=IfCondition(LaunchConfiguration("simulate")),
            ),
            *managed,
            OpaqueFunction(function=controller_of, condition=IfCondition(LaunchConfiguration("controller"))),
        ]
    )
