"""Learning a curve: known ones come back from noisy samples, few knots where few are enough, none where nothing is."""

import numpy as np
import pytest

from signlin_ros.compiled import exact_tape
from signlin_ros.errors import InputError
from signlin_ros.learning.curve import learn
from signlin_ros.model import Model

COUNT = 20_000
NOISE = 0.1
T = np.arange(COUNT) * 5e-3
SPEED = 2.0 * np.sin(T) + np.sin(2.7 * T)
POSITION = 0.4 * np.sin(0.37 * T) + 0.1 * np.sin(5.1 * T)
LOAD = 3.0 * np.sin(0.6 * T)
LAWS = {
    "viscous": ("speed", lambda v: 0.4 * v),
    "saturating": ("speed", lambda v: np.tanh(v / 0.4)),
    "Stribeck": ("speed", lambda v: (0.5 + 0.4 * np.exp(-((v / 0.4) ** 2))) * np.sign(v) + 0.2 * v),
    "bump": ("position", lambda q: np.exp(-((q / 0.1) ** 2))),
}
COORDINATES = {"speed": SPEED, "position": POSITION, "load": LOAD}


def noisy(f, seed, size=NOISE):
    return -f + np.random.default_rng(seed).normal(0.0, size, np.size(f))


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("seed", range(3))
def test_a_known_curve_comes_back_from_noisy_samples(name, seed):
    over, law = LAWS[name]
    x = COORDINATES[over]
    found = learn({over: x}, noisy(law(x), seed))
    assert rms(found.force(x) + law(x)) < 0.05 * rms(law(x))
    assert found.unseen == pytest.approx(NOISE, rel=0.05)  # what is left of it is the noise
    assert found.before == pytest.approx(np.hypot(rms(law(x)), NOISE), rel=0.03)
    assert found.explained > 0.5
    assert (found.jump > 0.3) == (name == "Stribeck")
    assert found.knots[0].size <= 10


def test_a_line_needs_no_more_than_the_first_knots():
    found = learn({"speed": SPEED}, noisy(0.4 * SPEED, 5))
    assert found.knots[0].size == 3
    assert found.jump == 0.0


@pytest.mark.parametrize("seed", range(3))
def test_where_nothing_is_nothing_is_explained(seed):
    found = learn({"position": POSITION}, noisy(np.zeros(COUNT), seed))
    assert abs(found.explained) < 0.01
    assert found.knots[0].size <= 3


def test_the_unseen_error_tells_what_blocks_do_not_share():
    """A curve that differs from record to record is of no use for the next one; the seen error does not tell."""
    blocks = np.arange(COUNT) * 6 // COUNT
    level = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])[blocks]
    found = learn({"position": POSITION}, noisy(level * LAWS["bump"][1](POSITION), 1), blocks=blocks)
    assert found.explained < 0.1


def test_samples_without_weight_or_that_are_no_numbers_do_not_count():
    f, spoilt = 0.4 * SPEED, np.arange(COUNT) % 7 == 0
    force = noisy(f, 2)
    weights = np.where(spoilt, 0.0, 1.0)
    wrong = np.where(spoilt, 100.0, force)
    one, other = learn({"speed": SPEED}, wrong, weights), learn({"speed": SPEED}, np.where(spoilt, np.nan, force))
    np.testing.assert_allclose(one.values, other.values, rtol=1e-9)
    assert rms(one.force(SPEED) + f) < 0.02 * rms(f)


def test_a_rising_curve_rises_and_a_dissipative_one_takes_energy():
    v = np.linspace(-4.0, 4.0, 2001)
    weak = noisy(0.02 * SPEED, 3, size=0.5)[::20]  # so little that noise makes a free curve fall here and there
    rising = learn({"speed": SPEED[::20]}, weak, shape="rising", jump=False)
    assert np.all(np.diff(rising.force(v)) <= 1e-12)
    taking = learn({"speed": SPEED[::20]}, weak, shape="dissipative")
    assert np.all(v * taking.force(v) <= 1e-12)


def test_two_coordinates_make_a_surface():
    def law(v, load):
        return (0.3 + 0.2 * np.abs(load)) * np.tanh(v / 0.2)

    f = law(SPEED, LOAD)
    both = learn({"speed": SPEED, "load": LOAD}, noisy(f, 1))
    alone = learn({"speed": SPEED}, noisy(f, 1))
    assert rms(both.force(SPEED, LOAD) + f) < 0.15 * rms(f)
    assert both.unseen < 0.8 * alone.unseen
    assert both.values.size == both.knots[0].size * both.knots[1].size


@pytest.mark.parametrize("over", [("speed",), ("position",), ("speed", "load")])
def test_what_was_learned_is_an_effect_with_the_same_force(over):
    x = {name: COORDINATES[name] for name in over}
    found = learn(x, noisy(np.sign(SPEED) + sum(np.cos(2.0 * c) for c in x.values()), 4))
    model = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.0, "k": 0.0}})
    model = model.with_effect("learned_force", **found.parameters())
    again = Model.from_dict(model.to_dict())
    assert again == model
    for q, v, load in ((0.1, 0.5, 2.0), (-0.3, -1.2, -1.0), (0.37, 4.0, 0.4)):
        point = {"position": q, "speed": v, "load": load}
        want = load + float(found.force(*([point[name]] for name in over))[0])
        signs = np.full(len(model.trace.surfaces), np.sign(v))
        got = exact_tape(again.structure).batch([q, v, load, *again.p, *signs])[1, 0]
        assert got == pytest.approx(want, rel=1e-12)


@pytest.mark.parametrize(
    ("coordinates", "more", "words"),
    [
        ({"velocity": SPEED}, {}, "coordinates: found velocity; allowed: speed; position; load; speed, position"),
        (
            {"position": POSITION},
            {"shape": "round"},
            "shape: found 'round' over position; allowed: dissipative, free, rising",
        ),
        ({"position": POSITION}, {"shape": "dissipative"}, "dissipative over the speed alone"),
        ({"speed": SPEED[:-1]}, {}, r"speed: found shape \(19999,\); allowed: \(20000,\)"),
        ({"speed": SPEED}, {"blocks": np.zeros(COUNT)}, "blocks: found one"),
        ({"speed": np.ones(COUNT)}, {}, "speed: found the same value in all samples"),
        ({"speed": np.full(COUNT, np.nan)}, {}, "found 0 samples that are numbers; allowed: 20 or more"),
    ],
)
def test_what_cannot_be_learned_from_is_refused(coordinates, more, words):
    with pytest.raises(InputError, match=words):
        learn(coordinates, np.zeros(COUNT), **more)
