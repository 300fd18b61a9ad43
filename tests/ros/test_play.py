"""The node ``play``: when it sends what, what makes it give up, what it records; and all of it over ROS 2."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.simulation import Stepper
from sim_nodes.playing import ABORTED, DONE, Command, Player, evened, read_command, read_limits

STEP = 0.01


@pytest.fixture
def model() -> Model:
    return Model.load("dc_motor")


@pytest.fixture
def command(tmp_path: Path) -> Path:
    t = STEP * np.arange(100)
    u = np.where((t > 0.2) & (t < 0.8), 2.0, 0.0)
    np.savetxt(tmp_path / "next.csv", np.column_stack([t, u]), delimiter=",", header="t,voltage", comments="")
    return tmp_path / "next.csv"


def driven(player: Player, seconds: float, push: float = 0.0) -> list[float]:
    """Play to a simulated machine; ``push``: what is added to the speed that is shown, from 1.5 s on."""
    plant, sent = Stepper(player.model), []
    for k in range(round(seconds / STEP)):
        x = plant.x.copy()
        x[player.model.states.index("speed")] += push * (k * STEP > 1.5)
        u = player.take(x, 100.0 + k * STEP)
        sent.append(u)
        plant.advance(STEP, [u])
    return sent


def test_a_command_is_played_twice_with_rests_and_recorded(model: Model, command: Path, tmp_path: Path) -> None:
    player = Player(model, read_command(model, str(command), 3.0), {"speed": 60.0}, runs=2, pause=0.5)
    sent = np.array(driven(player, 4.0))
    assert player.place == DONE
    assert sent.max() == 2.0
    assert sent[-1] == 0.0
    assert np.count_nonzero(np.diff(sent) > 0) == 2
    files = player.written(str(tmp_path / "run.csv"))
    assert [Path(f).name for f in files] == ["run.csv", "run_again.csv"]
    table = np.genfromtxt(files[1], delimiter=",", names=True)
    assert table.dtype.names == ("t", "voltage", "current", "speed")
    assert table["t"][0] == 0.0
    np.testing.assert_allclose(np.diff(table["t"]), STEP, atol=1e-9)
    np.testing.assert_allclose(table["voltage"], np.genfromtxt(command, delimiter=",", names=True)["voltage"])
    assert table["speed"].max() > 1.0


def test_a_state_near_its_limit_ends_it_with_zero(model: Model, command: Path) -> None:
    player = Player(model, read_command(model, str(command), 3.0), {"speed": 60.0}, runs=2, pause=0.1)
    sent = driven(player, 3.0, push=58.0)
    assert player.place == ABORTED
    assert "speed is at" in player.why
    assert "limit 60" in player.why
    assert sent[-1] == 0.0
    assert not any(sent[152:])


def test_a_state_that_does_not_come_ends_it_with_zero(model: Model, command: Path) -> None:
    player = Player(model, read_command(model, str(command), 3.0), {}, runs=1, pause=0.0, timeout=0.1)
    x = np.zeros(2)
    for k in range(40):
        player.take(x, k * STEP)
    assert player.u == 2.0
    assert player.tick(0.45) == 2.0
    assert player.tick(0.55) == 0.0
    assert player.place == ABORTED
    assert "no state has come" in player.why
    assert player.take(x, 0.6) == 0.0


def test_a_position_s_limit_is_its_way_from_the_start(command: Path) -> None:
    model = Model.load("dc_motor").with_options(with_position=True)
    player = Player(model, read_command(model, str(command), 3.0), {"position": 1.0}, runs=1, pause=0.0)
    at = model.states.index("position")
    x = np.zeros(len(model.states))
    x[at] = 7.0
    player.take(x, 0.0)
    x[at] = 7.9
    player.take(x, 0.01)
    assert player.place != ABORTED
    x[at] = 7.99
    player.take(x, 0.02)
    assert player.place == ABORTED


def test_a_ramp_fades_the_command_in(model: Model, command: Path) -> None:
    faded = read_command(model, str(command), 3.0, ramp=0.5)
    assert faded.at(0.25) == pytest.approx(1.0)
    assert faded.at(0.7) == 2.0
    assert faded.at(-0.1) == faded.at(1.2) == 0.0


@pytest.mark.parametrize(("limit", "ramp", "told"), [(1.5, 0.0, "beyond its limit 1.5"), (0.0, 0.0, "limit: missing")])
def test_a_command_beyond_its_limit_is_refused(
    model: Model, command: Path, limit: float, ramp: float, told: str
) -> None:
    with pytest.raises(InputError, match=told):
        read_command(model, str(command), limit, ramp)


@pytest.mark.parametrize(("text", "told"), [("sped=3", "unknown state 'sped'"), ("speed=0", "a positive number")])
def test_limits_that_are_none_are_refused(model: Model, text: str, told: str) -> None:
    with pytest.raises(InputError, match=told):
        read_limits(model, text)


def test_times_of_arrival_are_evened_unless_something_was_lost() -> None:
    g = np.random.default_rng(0)
    even = STEP * np.arange(400)
    late = even + 0.2 * STEP * g.random(400)
    np.testing.assert_allclose(np.diff(evened(late - late[0])), STEP, rtol=0.01)
    lost = np.delete(even, range(100, 150))
    np.testing.assert_array_equal(evened(lost), lost)


def test_a_command_holds_each_value_until_the_next() -> None:
    command = Command(np.array([0.0, 0.1, 0.2]), np.array([1.0, 2.0, 3.0]))
    assert [command.at(t) for t in (0.0, 0.05, 0.1, 0.25, 0.31)] == [1.0, 1.0, 2.0, 3.0, 0.0]


@pytest.mark.ros
def test_a_plan_is_played_over_ros(graph: Any, command: Path, tmp_path: Path) -> None:
    graph.start("plant_simulator", "publish_rate:=100.0", "noise:=0.01")
    options = [f"command:={command}", f"output:={tmp_path / 'run.csv'}", "limit:=3.0", "limits:=speed=60"]
    play = graph.start("play", *options, "pause:=0.2", "ramp:=0.0", "state_timeout:=2.0")
    graph.wait(lambda: not play.running, "the end of the play", 60.0)
    assert play.popen.returncode == 0
    assert "done; recorded" in play.output
    for name in ("run.csv", "run_again.csv"):
        table = np.genfromtxt(tmp_path / name, delimiter=",", names=True)
        assert table["voltage"].max() == 2.0
        assert table["speed"].max() > 1.0


@pytest.mark.ros
@pytest.mark.parametrize(
    ("options", "told"), [([], "command: missing"), (["limit:=1.0"], "beyond its limit 1"), (["limit:=3.0"], "output")]
)
def test_a_play_that_cannot_be_is_refused_in_one_line(graph: Any, command: Path, options: list[str], told: str) -> None:
    play = graph.start("play", *([f"command:={command}"] if options else []), *options)
    graph.wait(lambda: not play.running, "the end", 60.0)
    assert play.popen.returncode == 2
    assert told in play.output
    assert "Traceback" not in play.output
