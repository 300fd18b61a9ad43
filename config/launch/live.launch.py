"""A joint with its linearizer, monitor and controller; include it once for each namespace.

ros2 launch signlin_ros live.launch.py params_file:=/path/to/model.yaml limit:=12.0 namespace:=joint1 simulate:=false
"""

from pathlib import Path

import yaml
from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, LogInfo, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node

SHARE = Path(get_package_share_directory("signlin_ros"))
SHIPPED = SHARE / "config" / "dc_motor.yaml"
SHIPPED_LIMIT = 12.0
"""Largest |voltage| in V of the shipped motor; of any other drive only its owner knows the limit."""
NO_LIMIT = "no controller: give limit:=..., the largest |input| that the drive may be given (or controller:=false)"
SIGNLIN = SHARE.parents[1] / "lib" / "signlin_ros" / "signlin"
DEFAULTS = {"state_source": "joint_state"}
"""What holds where neither the parameter file nor an argument says otherwise."""
WATCHDOG_PERIODS, CONTROL_PERIOD = 5, 0.02
"""Control periods without an input after which a simulated drive's watchdog ends the last one; s of one by default."""
YES = ("true", "1")
GIVEN = ("state_source", "joint_name")
"""Arguments that are parameters of all nodes that have them; one that is not given leaves the file's value."""


def said_in(file: str) -> dict:
    """Return the parameters in a file; none where it cannot be read: the nodes say why."""
    try:
        content = yaml.safe_load(Path(file).read_text(encoding="utf-8"))
        return dict(next(iter(content.values()))["ros__parameters"])
    except (OSError, yaml.YAMLError, AttributeError, KeyError, TypeError, StopIteration):
        return {}


def nodes_of(context: LaunchContext) -> list:
    """Return the nodes, on the parameter file and on what was given beside it."""

    def told(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    file = told("params_file")
    given = [{name: told(name)} for name in GIVEN if told(name)]
    where = {"package": "signlin_ros", "namespace": told("namespace"), "output": "screen"}
    managed = [
        LifecycleNode(**where, executable=name, name=name, parameters=[DEFAULTS, file, *given])
        for name in ("linearizer", "monitor")
    ]
    joint = [one for one in given if "joint_name" in one]

    def simulated(*driven: dict) -> list:
        parameters = [*driven, file, *joint]
        simulator = Node(**where, executable="plant_simulator", parameters=parameters)
        return [simulator] if told("simulate").lower() in YES else []

    if told("controller").lower() not in YES:
        return [*simulated(), *managed]
    limit = told("limit") or said_in(file).get("limit", SHIPPED_LIMIT if Path(file) == SHIPPED else 0.0)
    if not float(limit) > 0.0:
        return [*simulated(), *managed, LogInfo(msg=NO_LIMIT)]
    options = [DEFAULTS, file, {"limit": float(limit)}, *given]
    watchdog = {"watchdog": WATCHDOG_PERIODS * float(said_in(file).get("control_period", CONTROL_PERIOD))}
    return [*simulated(watchdog), *managed, Node(**where, executable="controller", parameters=options)]


def generate_launch_description() -> LaunchDescription:
    """Start the nodes on one parameter file; what they need is compiled first (`signlin warm`)."""
    named = {
        "state_source": "array or joint_state; empty: what the parameter file says, else joint_state",
        "joint_name": "of the joint in joint_states; empty: what the parameter file says, else joint",
        "limit": "largest |input| of the controller; empty: what the parameter file says",
    }
    return LaunchDescription(
        [
            DeclareLaunchArgument("params_file", default_value=str(SHIPPED)),
            DeclareLaunchArgument("namespace", default_value=""),
            DeclareLaunchArgument("simulate", default_value="true", description="whether plant_simulator is started"),
            DeclareLaunchArgument("controller", default_value="true", description="whether a controller is started"),
            *(DeclareLaunchArgument(name, default_value="", description=text) for name, text in named.items()),
            SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", str(SHIPPED.parent / "fastdds_profile.xml")),
            ExecuteProcess(cmd=[str(SIGNLIN), "warm", LaunchConfiguration("params_file")], output="log"),
            OpaqueFunction(function=nodes_of),
        ]
    )
