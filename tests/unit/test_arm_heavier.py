"""A link that is heavier than in the URDF: told with its factor, or that the records would not show it."""

import numpy as np
import pytest

from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.told import diagnosed_json
from signlin_ros.arms.verbs import diagnose
from signlin_ros.robots import regressor
from signlin_ros.robots.inertia import TEN
from tests.arm_records import record, reference, small

MODEL, BAND, LINK = small(), 6.0, 1


def run(source, seed, factor):
    """Return a record of an arm whose second link is a number of times as heavy as in its URDF."""
    (t, q, v, u), (_, *motion) = record(MODEL, seed), reference(seed, 24.0, MODEL.robot.n)
    own = slice(TEN * LINK, TEN * (LINK + 1))
    more = regressor(MODEL.robot, *motion)[:, :, own] @ MODEL.robot.pi[own]
    return ArmRun(t, q, v, u + (factor - 1.0) * more, source, np.zeros(q.shape[1]))


@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_a_link_that_is_heavier_is_told_or_by_how_much_it_would_have_to_be(factor):
    found = diagnose(MODEL, [run("a.csv", 51, factor)], [run("b.csv", 52, factor)], BAND)
    heavy, content = found.heaviness, diagnosed_json(found, "", "", [])
    assert abs(heavy.factors[LINK] - factor) < 3.0 * heavy.errors[LINK]
    name = MODEL.robot.names[LINK]
    notes = [note for note in content["notes"] if "times as heavy" in note or "as heavy as there" in note]
    untold = [said for said in content["joints"][name]["cannot_tell"] if "is heavier than the URDF says" in said]
    if factor == 1.0:
        assert heavy.told == ()
        assert notes == []
        assert len(untold) == 1
    else:
        assert heavy.told[0] == LINK
        (note,) = notes
        assert f"carried by {name}" in note
        assert untold == []
