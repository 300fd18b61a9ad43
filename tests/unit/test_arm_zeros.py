"""A joint that is counted from elsewhere: bodies swallow it, their distance from the URDF tells it."""

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.distance import body_distance
from signlin_ros.arms.fit import FitDesign, fit, prior
from signlin_ros.arms.keys import ZERO, Key
from signlin_ros.arms.laws import zero
from signlin_ros.arms.piece import ArmSegment, RegressionRows
from signlin_ros.arms.proposal import placed
from signlin_ros.arms.told import compared_json, diagnosed_json, sentences
from signlin_ros.arms.verbs import compare, diagnose
from signlin_ros.model import Model
from signlin_ros.robots import inverse_dynamics, read_urdf
from signlin_ros.robots.write import with_zeros
from tests.arm_records import record, small

MODEL, BAND, SHOULDER = small(), 6.0, 1
N, OFFSET = MODEL.robot.n, 0.5
SCHEMA = json.loads((Path(__file__).parents[2] / "signlin_ros/schemas/arm_diagnose.json").read_text())
SLIDES = """<robot name="r"><link name="base"/>
<link name="a"><inertial><origin xyz="0.1 0 0.2"/><mass value="2"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.02"/></inertial></link>
<link name="b"><inertial><origin xyz="0 0.1 0.3"/><mass value="1"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.02"/></inertial></link>
<joint name="turns" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0 0.2 0.1" rpy="0.3 1.2 -2.0"/>
<axis xyz="1 2 3"/><limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
<joint name="slides" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 1"/>
<limit lower="0" upper="2" effort="1" velocity="1"/></joint></robot>"""


def run(seed, offset=0.0):
    t, q, v, u = record(MODEL, seed)
    return ArmRun(t, q + offset * (np.arange(N) == SHOULDER), v, u, "simulated", np.zeros(N))


def test_a_urdf_counts_from_other_zeros():
    """What joints need at a position of the one is what they need farther on in the other, and so are its limits."""
    rng = np.random.default_rng(3)
    q, v, a = rng.normal(size=(3, 20, 2))
    offsets = {"turns": 0.7, "slides": -0.4}
    other = read_urdf(with_zeros(SLIDES, offsets))
    needed = inverse_dynamics(read_urdf(SLIDES), q + list(offsets.values()), v, a)
    np.testing.assert_allclose(inverse_dynamics(other, q, v, a), needed, atol=1e-10)
    assert dict(other.joints[0].limits)["upper"] == pytest.approx(1.3)
    assert dict(other.joints[1].limits)["lower"] == pytest.approx(0.4)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2])
def test_a_joint_that_stands_upright_is_turned_too(pitch):
    text = SLIDES.replace("0.3 1.2 -2.0", f"0.3 {pitch} -2.0")
    q, rest, farther = np.array([[0.2, 0.1]]), np.zeros((1, 2)), np.array([0.0, 0.1])
    turned = inverse_dynamics(read_urdf(with_zeros(text, {"slides": 0.1})), q, rest, rest)
    np.testing.assert_allclose(turned, inverse_dynamics(read_urdf(text), q + farther, rest, rest), atol=1e-9)


def test_the_column_of_a_zero_is_what_the_urdf_needs_more():
    rows = RegressionRows([ArmSegment(MODEL.robot, np.eye(N), run(71), BAND)])
    pi, step = MODEL.robot.pi, 1e-4
    moved = RegressionRows([ArmSegment(MODEL.robot, np.eye(N), run(71, step), BAND)])
    difference = (moved.Y - rows.Y) @ pi / step
    column = zero(rows, SHOULDER, pi)[:, 0]
    assert np.linalg.norm(column - difference) < 1e-3 * np.linalg.norm(difference)
    assert not zero(rows, 0, pi).any()  # the waist turns about gravity


def test_distances_are_what_chance_makes_of_them_and_more_where_bodies_are_beyond():
    """Bodies drawn from the prior: the mean of Wald's statistic is the number of combinations (8 draws)."""
    rng = np.random.default_rng(11)
    rows = RegressionRows([ArmSegment(MODEL.robot, np.eye(N), run(72), BAND)])
    sd = prior(MODEL.robot, 0.1)
    free = rng.normal(size=(len(rows), 2))
    X = np.concatenate([rows.Y, free], axis=1)
    mean, open_ = np.r_[MODEL.robot.pi, 0.0, 0.0], np.r_[sd, np.inf, np.inf]
    names = (*(f"{name}.{k}" for name in MODEL.robot.names for k in range(10)), "a", "b")

    def drawn(times):
        other = replace_y(rows, X @ (mean + np.r_[times * sd * rng.normal(size=sd.size), 1.0, 2.0]))
        other.y = other.y + rng.normal(size=len(rows))
        return body_distance(fit(FitDesign(names, X, X, mean, open_), other, other, np.ones(N)))

    right, beyond = [drawn(1.0) for _ in range(8)], [drawn(10.0) for _ in range(8)]
    told = sum(d.combinations for d in right)
    assert told > 40
    assert abs(sum(d.statistic for d in right) - told) < 4.0 * np.sqrt(2.0 * told)
    assert not any(d.beyond for d in right)
    assert all(d.beyond for d in beyond)


def replace_y(rows, y):
    other = RegressionRows(rows.pieces)
    other.y = y
    return other


@pytest.mark.slow
def test_an_encoder_whose_zero_is_off_is_told_and_written(tmp_path):
    known, unseen = run(73, OFFSET), run(74, OFFSET)
    before = compare(MODEL, [known], [unseen], BAND)
    assert before.bodies.beyond
    assert any("than its tolerance" in note for note in compared_json(before, "", [])["notes"])
    found = diagnose(MODEL, [known], [unseen], BAND)
    silent = replace(found, found=(), witnesses=(), comparison=before)
    assert "bodies are not those of the URDF" in sentences(silent)[-1]
    assert [law.key for law in found.found] == [Key(ZERO, SHOULDER)]
    content = diagnosed_json(found, "", "", []) | {"sentences": sentences(found), "record": {"findings": []}}
    jsonschema.validate(content, SCHEMA)
    told = content["robot"]["zeros"]["shoulder"]
    assert told["value"] == pytest.approx(OFFSET, abs=4.0 * told["std"])
    assert told["std"] < 0.1 * OFFSET
    assert not any("than its tolerance" in note for note in content["notes"])
    # the URDF that is written counts as the encoder does
    text, urdf, path = placed(found.proposal, tmp_path / "new.yaml")
    path.write_text(urdf)
    (tmp_path / "new.yaml").write_text(text)
    new = Model.load(tmp_path / "new.yaml")
    again = compare(new, [known], [unseen], BAND)
    np.testing.assert_allclose(again.table.model, found.comparison.table.model, rtol=0.02)
    assert not again.bodies.beyond
    q = known.q[::100]
    rest = np.zeros_like(q)
    right = inverse_dynamics(MODEL.robot, q - OFFSET * (np.arange(N) == SHOULDER), rest, rest)
    assert np.abs(inverse_dynamics(new.robot, q, rest, rest) - right).max() < 0.1 * np.abs(right).max()


@pytest.mark.slow
def test_zeros_that_are_right_are_silent():
    found = diagnose(MODEL, [run(75)], [run(76)], BAND)
    assert found.found == ()
    assert not found.comparison.bodies.beyond
    assert "wrong zero" in sentences(found)[-1]
