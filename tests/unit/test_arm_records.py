"""Records of an arm in the files that people have (columns, echoes of topics, bags), found by the joints' names."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from signlin_ros.arms.data import read_data, runs_of
from signlin_ros.arms.numbered import signals_by_number
from signlin_ros.errors import RecordError
from signlin_ros.model import Model
from signlin_ros.records.formats.echo import joint_states
from tests.arm_records import record, small, written
from tests.unit.test_records_bag import joints, write_bag

MODEL = small()
NAMES = MODEL.robot.names
T, Q, V, U = (x[:400] for x in record(MODEL, 1))
ORDER = [2, 0, 1]


def runs(path, model=MODEL):
    (data,) = read_data(model, [str(path)], {})
    (run,) = runs_of(model, data)
    return run


def lines(t=T, q=Q, v=V, u=U, order=ORDER):
    names = [NAMES[i] for i in order]
    stamp = 1_700_000_000 + t
    return [
        ",".join(
            [
                str(int(s)),
                str(round((s - int(s)) * 1e9)),
                "base",
                *names,
                *(f"{row[i]:.9g}" for row in (a, b, c) for i in order),
            ]
        )
        for s, a, b, c in zip(stamp, q, v, u, strict=True)
    ]


def test_topic_echo_of_joint_states_is_read_by_names(tmp_path):
    path = tmp_path / "echo.csv"
    path.write_text("\n".join(lines()) + "\n")
    run, plain = runs(path), runs(written(tmp_path / "run.csv", NAMES, T, Q, V, U))
    np.testing.assert_allclose(run.q, plain.q, atol=1e-6)
    np.testing.assert_allclose(run.v, plain.v, atol=1e-6)
    np.testing.assert_allclose(run.tau, plain.tau, atol=1e-5)
    assert run.step == pytest.approx(plain.step, rel=1e-6)


def test_topic_echo_whose_order_changes_is_read_by_names(tmp_path):
    path = tmp_path / "echo.csv"
    mixed = [*lines()[:200], *lines(order=[0, 1, 2])[200:]]
    path.write_text("\n".join(mixed) + "\n")
    np.testing.assert_allclose(runs(path).q, Q, atol=1e-6)


def test_columns_by_number_stay_as_they_are():
    text = "\n".join(lines()[:3])
    assert joint_states(text, ("c10",)) is None
    assert joint_states("1,2,base,wheel,0.1,0.2,0.3\n" * 3) is None
    assert joint_states("1,2,3,4,5,6,7,8,9,10,11\n" * 3) is None


def numbered(stems, ks):
    return [stem.format(k) for stem in stems for k in ks]


RTDE = ["timestamp", *numbered(("target_q_{}", "actual_q_{}", "actual_qd_{}", "actual_current_{}"), range(3))]
TORQUES = ["time", *numbered(("q{}_meas", "tau_J{} [Nm]"), (1, 2, 3))]
DRIVES = ["time_ms", *numbered(("joint_{}_pos_deg", "joint_{}_vel_deg_s", "joint_{}_cur", "joint_{}_temp"), (1, 2, 3))]


@pytest.mark.parametrize(
    ("head", "position", "effort"),
    [
        (RTDE, "actual_q_1", "actual_current_1"),
        (TORQUES, "q2_meas", "tau_J2"),
        (DRIVES, "joint_2_pos_deg", "joint_2_cur"),
    ],
)
def test_columns_that_number_the_joints_are_proposed_as_signals(head, position, effort, tmp_path):
    """UR's RTDE, a torque log, a drive's log: what the error says may be pasted, and is read then."""
    path = tmp_path / "run.csv"
    rows = np.column_stack([T, *(np.sin(T + k) for k in range(len(head) - 1))])
    np.savetxt(path, rows, delimiter=",", header=",".join(head), comments="")
    with pytest.raises(RecordError, match="number the joints") as error:
        read_data(MODEL, [str(path)], {})
    block = yaml.safe_load(str(error.value).partition("may say ")[2])["signals"]
    second = MODEL.robot.names[1]
    assert block[f"{second}.position"] == position.removesuffix("_deg")
    assert block[f"{second}.effort"] == effort
    (record,) = read_data(MODEL, [str(path)], block)
    column = [name.partition(" ")[0] for name in head].index(position)
    size = np.radians(1.0) if position.endswith("deg") else 1.0
    np.testing.assert_allclose(record.measured[f"{second}.position"], size * rows[:, column], atol=1e-9)


def test_columns_whose_meaning_is_open_are_not_proposed():
    assert (
        signals_by_number(
            ["q_0", "q_1", "q_2", "angle_0", "angle_1", "angle_2", "tau_0", "tau_1", "tau_2"], MODEL.robot
        )
        == {}
    )
    assert signals_by_number(["q_0", "q_1", "tau_0", "tau_1"], MODEL.robot) == {}  # of another robot
    assert signals_by_number(["q_2", "q_3", "q_4", "tau_2", "tau_3", "tau_4"], MODEL.robot) == {}


def test_a_bag_of_joint_states_is_read_by_names(tmp_path):
    own = [NAMES[i] for i in ORDER]
    messages = []
    for s, a, b, c in zip(T, Q, V, U, strict=True):
        stamp = 1_700_000_000_000_000_000 + round(1e9 * s)
        message = replace(joints(stamp, own, a[ORDER], b[ORDER]), effort=c[ORDER])
        messages.append(("/joint_states", stamp, message))
    path = write_bag(tmp_path / "bag", messages)
    run = runs(path)
    np.testing.assert_allclose(run.q, Q, atol=1e-12)
    np.testing.assert_allclose(run.tau, U, atol=1e-12)


def test_currents_with_gains_are_torques(tmp_path):
    gains = np.array([8.0, 9.0, -10.0])
    content = MODEL.to_dict()
    for name, gain in zip(NAMES, gains, strict=True):
        content[name] = {**content[name], "effort": {"gain": float(gain)}}
    model = Model.from_dict(content, folder=MODEL.folder)
    path = written(tmp_path / "run.csv", NAMES, T, Q, V, U / gains)
    text = (tmp_path / "run.csv").read_text().replace("effort [N·m]", "effort [A]")
    (tmp_path / "run.csv").write_text(text)
    np.testing.assert_allclose(runs(path, model).tau, U, atol=1e-4)


def test_the_way_out_is_that_of_an_arm(tmp_path):
    written(tmp_path / "run.csv", NAMES, T, Q, V, U)
    text = (tmp_path / "run.csv").read_text()
    (tmp_path / "amperes.csv").write_text(text.replace("elbow.effort [N·m]", "elbow.effort [A]"))
    with pytest.raises(RecordError, match=r"elbow: \{effort: \{gain: \.\.\.\}\}"):
        read_data(MODEL, [str(tmp_path / "amperes.csv")], {})
    (tmp_path / "less.csv").write_text(text.replace("elbow.effort", "gripper.effort"))
    with pytest.raises(RecordError, match="leave elbow out of joints"):
        read_data(MODEL, [str(tmp_path / "less.csv")], {})


def as_called(called, names=(), order=ORDER):
    """Return a CSV of three quantities for each joint, called by joint, quantity and place; ``names`` (head, word)
    stand in front of every row.
    """
    quantities = (("position", Q), ("velocity", V), ("effort", U))
    head = [
        "time",
        *(one for one, _ in names),
        *(called(NAMES[i], w, k) for w, _ in quantities for k, i in enumerate(order)),
    ]
    words = [word for _, word in names]
    rows = [
        ",".join([f"{t:.3f}", *words, *(f"{x[row, i]:.9g}" for _, x in quantities for i in order)])
        for row, t in enumerate(T)
    ]
    return "\n".join([",".join(head), *rows]) + "\n"


SHORT = {"position": "pos", "velocity": "vel", "effort": "torque"}


@pytest.mark.parametrize(
    "text",
    [
        as_called(lambda joint, what, k: f"/joint_states/{joint}/{what}"),
        as_called(lambda joint, what, k: f"{joint}_{SHORT[what]}"),
        as_called(lambda joint, what, k: f"{what}_{k}", [(f"name_{k}", NAMES[i]) for k, i in enumerate(ORDER)]),
        as_called(
            lambda joint, what, k: f"field.{what}{k}", [(f"field.name{k}", NAMES[i]) for k, i in enumerate(ORDER)]
        ),
    ],
    ids=["PlotJuggler", "short names", "bagpy", "rostopic echo -p"],
)
def test_joints_are_found_however_a_table_calls_them_and_it_is_told(text, tmp_path):
    file = tmp_path / "run.csv"
    file.write_text(text)
    run = runs(file)
    for found, right in ((run.q, Q), (run.v, V), (run.tau, U)):
        np.testing.assert_allclose(found, right, rtol=1e-8)
    (data,) = read_data(MODEL, [str(file)], {})
    assert any("found by the joints' names" in note and f"{NAMES[0]}.effort is" in note for note in data.notes)


def test_a_joint_that_two_columns_may_be_is_asked_for(tmp_path):
    """Commands and measurements are both called by the joint."""
    file = tmp_path / "run.csv"
    both = as_called(lambda joint, what, k: f"/state/{joint}/{what}").splitlines()
    wanted = [f"/command/{joint}/position" for joint in NAMES]
    rows = [f"{row},0.1,0.2,0.3" for row in both[1:]]
    file.write_text("\n".join([",".join([both[0], *wanted]), *rows]) + "\n")
    with pytest.raises(RecordError, match=rf"{NAMES[0]}\.position.* missing.*--signal {NAMES[0]}\.position=COLUMN"):
        read_data(MODEL, [str(file)], {})
