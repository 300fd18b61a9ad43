"""Every command of docs/howto/my_own_record.md's ten shapes runs, on files of these shapes."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

from signlin_ros.cli import signlin
from signlin_ros.model import Model
from signlin_ros.simulation import simulate

pytestmark = pytest.mark.slow

PAGE = Path(__file__).parents[2] / "docs" / "howto" / "my_own_record.md"
MOTOR = Model.load("dc_motor")
T = np.arange(300) * 0.01
NOISE = np.random.default_rng(1).normal(size=(300, 2)) * [0.01, 0.1]


def commands() -> list[str]:
    """The commands of the ten shapes."""
    text = PAGE.read_text(encoding="utf-8").split("### The ten commonest shapes")[1].split("\nA formula has")[0]
    return [line.strip() for line in text.splitlines() if re.match(r"\s+signlin ", line)]


def test_there_are_ten_shapes() -> None:
    shapes = PAGE.read_text(encoding="utf-8").split("### The ten commonest shapes")[1]
    assert re.findall(r"^(\d+)\. \*\*", shapes, re.MULTILINE) == [str(i) for i in range(1, 11)]
    assert len(commands()) == 11


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files that the commands name, all of the same run."""
    made = tmp_path_factory.mktemp("shapes")
    u = 6 * np.sin(7 * T) + 3 * np.sin(23 * T + 1)
    run = simulate(MOTOR, T, u[:, None])
    i, w = (run.x + NOISE).T
    (made / "my_motor.yaml").write_text(MOTOR.to_yaml(), encoding="utf-8")
    rpm, drive = w * 30 / np.pi, np.where(u < 0, "R", "F")
    write(made / "scope.csv", "Time (ms),Voltage (V),Current (mA),Speed (RPM)", 1e3 * T, u, 1e3 * i, rpm)
    write(made / "drive.csv", "t,u_cmd,i_mot,meas", T, u, 1e3 * i, -w / 0.10472)
    write(made / "arduino.csv", "time,voltage,current,speed", 1e3 * T, u, i, w)
    write(made / "even.csv", "voltage,current,speed", u, i, w)
    write(made / "driver.csv", "t,pwm,current,speed,dir", T, np.abs(u), i, w, drive)
    steps = np.round(w / 0.0015339808)
    write(made / "servo.csv", "t,voltage,current,speed", T, u, i, np.where(steps < 0, 32768 - steps, steps))
    sec, nsec = 1766147454 + np.floor(T + 1e-9), np.round(1e9 * (T % 1.0))
    write(made / "echo.csv", "", sec, nsec, np.full(T.size, "base"), 0 * T, 0 * T, w, i, u)
    with (made / "plotjuggler.csv").open("w") as file:
        file.write("__time,/cmd/data,/joint_states/wheel/velocity\n")
        for t, volt, speed in zip(T, u, w, strict=True):
            file.write(f"{t:.6f},,{speed:.5f}\n{t + 1e-6:.6f},{volt:.9f},\n")
    savemat(made / "experiment.mat", {"u": u[:, None], "y": np.column_stack([i, w]), "Ts": 0.01})
    write(made / "restarted.csv", "t,voltage,current,speed", *(np.tile(column, 2) for column in (T, u, i, w)))
    bag(made / "robot_bag", u, w)
    return made


def write(path: Path, header: str, *columns: np.ndarray) -> None:
    rows = zip(*(column.tolist() for column in columns), strict=True)
    body = [",".join(f"{cell:.12g}" if isinstance(cell, float) else cell for cell in row) for row in rows]
    path.write_text("\n".join([*([header] if header else []), *body]) + "\n")


def bag(path: Path, u: np.ndarray, w: np.ndarray) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    number, joint = "std_msgs/msg/Float64", "sensor_msgs/msg/JointState"
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        commands = writer.add_connection("/cmd", number, typestore=store)
        states = writer.add_connection("/joint_states", joint, typestore=store)
        for t, volt, speed in zip(np.round(T * 1e9).astype(int).tolist(), u.tolist(), w.tolist(), strict=True):
            stamp = store.types["builtin_interfaces/msg/Time"](sec=t // 10**9, nanosec=t % 10**9)
            head = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
            values = {"velocity": np.array([speed]), "position": np.empty(0), "effort": np.empty(0)}
            message = store.types[joint](header=head, name=["wheel"], **values)
            writer.write(states, t, store.serialize_cdr(message, joint))
            writer.write(commands, t + 1000, store.serialize_cdr(store.types[number](data=volt), number))


@pytest.mark.parametrize("command", commands(), ids=lambda command: shlex.split(command)[3])
def test_the_command_runs_and_the_true_model_fits(command: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    result = CliRunner().invoke(signlin, [*shlex.split(command)[1:], "--json"], catch_exceptions=False)
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert found["channels"]["speed"]["free_run"]["rmse_over_noise"] < 1.3
