"""What a search leaves out, since it would change nothing: starts that an observer knows as well, points in vain."""

import numpy as np
import pytest

from signlin_ros.diagnosis.output_error.evolution import FOLLOWED_BESIDE, FOLLOWED_FIRST, evolved_fit
from signlin_ros.diagnosis.output_error.trials import trials
from signlin_ros.fitting.candidate import candidate
from signlin_ros.fitting.fit import evaluated
from signlin_ros.fitting.prepare import prepared
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate

MOTOR = Model.load("dc_motor").with_options(with_position=True)
STEP, SIZE = 0.005, 400


def problem(noise: float):
    """Return the problem of a record of the motor whose encoder has that noise in rad."""
    t = STEP * np.arange(SIZE)
    u = (4 * np.sign(np.sin(2 * np.pi * 0.7 * t)) + 2 * np.sin(2 * np.pi * 1.7 * t))[:, None]
    x = simulate(MOTOR, t, u).x
    draw = np.random.default_rng(7)
    spread = {"current": 0.01, "speed": 0.05, "position": noise}
    measured = {n: v + spread[n] * draw.standard_normal(SIZE) for n, v in zip(MOTOR.states, x.T, strict=True)}
    data = ModelData(t, u, measured, None, MOTOR.inputs, MOTOR.states, MOTOR.units)
    return prepared(MOTOR, [data], [data])[0]


@pytest.mark.parametrize(("law", "noise", "sought"), [("gravity_load", 0.01, False), ("cogging_torque", 1e-4, False),
                                                      ("cogging_torque", 0.01, True)])  # fmt: skip
def test_a_position_is_sought_where_a_force_turns_within_what_its_sensor_cannot_tell(law, noise, sought):
    values = {"A": 0.01, "N": 60.0} if law == "cogging_torque" else {"A": 0.01}
    asked = problem(noise)
    c = candidate(asked, asked.base.with_effect(law, **values), (law,))
    assert evaluated(asked, c, c.start(), asked.observer_gains[0], False) is not None
    position = c.model.states.index("position")
    assert [position in key[2:] for key in c.starts] == ([True] if sought else [])


@pytest.mark.parametrize(("rival", "bred"), [(np.inf, True), (-1e9, False)])
def test_nothing_is_bred_of_points_that_are_less_likely_than_a_rival(rival, bred):
    asked = problem(1e-3)
    c = candidate(asked, asked.base, ())
    before, counts = evaluated(asked, c, c.start(), asked.observer_gains[0]), []

    def each(do, items):
        counts.append(len(items))
        return [do(item) for item in items]

    assert evolved_fit(asked, before, trials(asked, ["backlash"])[0], each, rival) is not None
    assert counts[1] <= FOLLOWED_BESIDE
    assert (len(counts) > 3) == bred
    assert not bred or counts[1] + counts[2] <= FOLLOWED_FIRST
