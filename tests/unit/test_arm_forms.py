"""The form of a viscous friction that grows ever more slowly: told where a record tells it, written as it is told."""

import os
from pathlib import Path

import numpy as np
import pytest

from signlin_ros.arms.data import ArmRun, read_data, sides
from signlin_ros.arms.feedforward import gains_content
from signlin_ros.arms.laws import EXTRA
from signlin_ros.arms.search import Key, admissible, possible
from signlin_ros.arms.told import effects_named
from signlin_ros.arms.verbs import diagnose
from signlin_ros.model import Model
from tests.arm_records import record, small

SHARED = Path(os.environ.get("SIGNLIN_DATA", "../shared/data")) / "joints"
MODEL, SHOULDER, BAND = small(), 1, 6.0


def runs(seed, of_speed):
    """Return a record to fit and an unseen one of the small arm with one more friction of its shoulder's speed."""
    found = []
    for k in (seed, seed + 1):
        t, q, v, u = record(MODEL, k)
        u[:, SHOULDER] += of_speed(v[:, SHOULDER])
        found.append(ArmRun(t, q, v, u, "simulated", np.zeros(q.shape[1])))
    return found


def named(found):
    names = found.comparison.study.names
    return {names[i]: effects for i, effects in effects_named(found).items()}


@pytest.mark.slow
def test_a_power_of_speed_is_named_in_the_place_of_a_cubic_law():
    known, unseen = runs(21, lambda v: 2.0 * np.abs(v) ** 0.5 * np.sign(v))
    found = diagnose(MODEL, [known], [unseen], BAND)
    assert named(found) == {"shoulder": ["power_law_friction"]}
    own = found.proposal.model.effects["shoulder.power_law_friction"].parameters
    assert 0.4 <= own["a"] <= 0.7
    assert own["c"] == pytest.approx(2.0, rel=0.3)
    table = found.comparison.table
    assert table.model[SHOULDER] < 0.8 * table.basic[SHOULDER]


@pytest.mark.slow
def test_a_cubic_law_keeps_its_name():
    known, unseen = runs(31, lambda v: -0.06 * v**3)
    fast = MODEL.urdf.replace('velocity="3.0"', 'velocity="6.0"')
    found = diagnose(Model.from_dict({**MODEL.to_dict(), "robot": fast}), [known], [unseen], BAND)
    assert named(found) == {"shoulder": ["cubic_viscous_friction"]}
    # friction that would drive the joint at the URDF's largest speed holds where it was recorded
    model, pieces = found.proposal.model, [piece for rows in found.state.both for piece in rows.pieces]
    assert model.operating_range == {"shoulder.velocity": max(np.abs(piece.v[:, SHOULDER]).max() for piece in pieces)}
    assert not [note for note in gains_content(model, {}, 0.01)["notes"] if "would drive" in note]


@pytest.mark.slow
def test_dry_friction_that_sets_in_gradually_is_no_power_of_speed():
    known, unseen = runs(41, lambda v: 0.5 * np.tanh(v / 0.02) - 0.06 * v**3)
    found = diagnose(MODEL, [known], [unseen], BAND)
    assert "power_law_friction" not in named(found).get("shoulder", [])


def test_a_power_of_speed_is_not_searched_for_by_itself():
    """Near standstill it looks like dry friction that sets in gradually."""
    assert "power_law_friction" not in [law.effect for law in EXTRA]


class Estimate:
    """Coefficients by name."""

    def __init__(self, **values):
        self.values, self.design = values, self
        self.names = tuple(values)

    def at(self, name):
        return self.names.index(name)

    def __getitem__(self, name):
        return self.values[name]


@pytest.mark.parametrize(("mu", "stands"), [(0.3, True), (-0.1, True), (-0.9, False)])
def test_a_law_that_drives_its_joint_does_not_stand(mu, stands):
    own = Estimate(**{"0.viscous_friction.b": 1.0, "0.coulomb_friction.mu": mu, "1.coulomb_friction.mu": -9.0})
    key = Key("stribeck_friction", 0, 0.5)
    assert possible(own, np.array(list(own.values.values())), np.full(3, 0.1), key) == stands
    assert admissible(own, key) == (mu >= 0.0)


@pytest.mark.slow
@pytest.mark.skipif(not SHARED.is_dir(), reason=f"no records at {SHARED} (set SIGNLIN_DATA)")
def test_a_measured_arm_is_told_its_coupling_and_the_powers_of_its_friction():
    """Stäubli TX40, 9 s, the coupling of joints 5 and 6 not in the file."""
    joints = [f"joint_{k}" for k in range(1, 7)]
    model = Model.from_dict({"plant": "arm", "robot": str(SHARED / "tx40.urdf"), "joints": joints})
    records = read_data(model, [str(SHARED / "tx40_500hz.csv")], {})
    found = diagnose(model, *sides(model, records, [], 0.6), 20.0)
    assert found.couplings == (("joint_5", "joint_6"),)
    assert (found.comparison.table.model <= [1.15, 1.5, 0.7, 0.55, 1.1, 0.8]).all()
    assert named(found)["joint_2"] == ["power_law_friction"]
    second, first = sides(model, records, [], 0.5)
    other = diagnose(model, first, second, 20.0)
    assert named(other)["joint_2"] == ["power_law_friction"]
    # what is written is what was judged: nothing of it is clipped
    assert (other.comparison.table.model <= 1.1 * other.estimate.rms).all()
