"""What happens at reversals is looked for in a wider band than that of the motion."""

from dataclasses import replace

import numpy as np
import pytest

from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.faults import delays
from signlin_ros.arms.piece import chosen_band, widest_band
from signlin_ros.arms.told import diagnosed_json, effects_named
from signlin_ros.arms.verbs import diagnose
from tests.arm_records import record, small

MODEL, ELBOW = small(), 2
EXCESS, WIDTH, GAINS = 0.4, 0.06, 40.0


def run(seed, excess):
    """Return a record of the small arm, the friction of whose elbow falls with speed."""
    t, q, v, u = record(MODEL, seed)
    u[:, ELBOW] += excess * np.exp(-((v[:, ELBOW] / WIDTH) ** 2)) * np.tanh(v[:, ELBOW] / 2e-3)
    return ArmRun(t, q, v, u, "simulated", np.zeros(q.shape[1]))


@pytest.mark.slow
def test_friction_that_falls_within_a_short_time_is_named_in_a_wider_band():
    known, unseen = run(41, EXCESS), run(42, EXCESS)
    narrow = chosen_band([known, unseen])
    assert narrow < widest_band([known, unseen])
    found = diagnose(MODEL, [known], [unseen])
    assert effects_named(found) == {ELBOW: ["stribeck_friction"]}
    (law,) = found.found
    assert law.key.shape == pytest.approx(WIDTH, rel=0.4)
    assert law.values[0] == pytest.approx(EXCESS, rel=0.25)
    content = diagnosed_json(found, "", "", [])
    assert content["band_hz"] == widest_band([known, unseen])
    assert any(f"not that of the motion, {narrow:g} Hz" in note for note in content["notes"])
    # a band that is asked for is kept
    assert diagnose(MODEL, [known], [unseen], narrow).comparison.study.band == narrow


@pytest.mark.slow
def test_the_band_stays_that_of_the_motion_where_nothing_happens_at_reversals():
    known, unseen = run(43, 0.0), run(44, 0.0)
    found = diagnose(MODEL, [known], [unseen])
    assert found.found == ()
    assert found.comparison.study.band == chosen_band([known, unseen])


@pytest.mark.slow
def test_what_a_controller_makes_of_noise_is_no_delay_in_the_wider_band():
    """Efforts answer the velocities' noise, whose second derivative is in the regressor of a delay."""
    rng, runs = np.random.default_rng(5), []
    for seed in (45, 46):
        one = run(seed, EXCESS)
        noise = [2e-2, 2e-2, 1e-3] * rng.normal(size=one.q.shape)
        runs.append([replace(one, v=one.v + noise, tau=one.tau - GAINS * noise)])
    found = diagnose(MODEL, *runs)
    assert found.comparison.study.band == widest_band([*runs[0], *runs[1]])
    assert effects_named(found) == {ELBOW: ["stribeck_friction"]}
    assert not delays(found).any()
