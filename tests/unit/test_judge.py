"""What a residual says: structure that channels share, colour, rounding, gains in blocks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from signlin_ros.diagnosis.judge import gain_in_blocks, gain_on, residue, residues, together, whiteness

from signlin_ros.diagnosis.problem import Segment, quanta

T = 4000


def coloured(rng, count=2, rho=0.8):
    return lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.normal(size=(T, count)), axis=0)


@pytest.mark.parametrize("seed", range(5))
def test_coloured_noise_of_two_sensors_is_not_shared(seed):
    assert together([coloured(np.random.default_rng(seed))]) == set()


@pytest.mark.parametrize("seed", range(5))
def test_a_missing_oscillation_is(seed):
    rng = np.random.default_rng(seed)
    common = coloured(rng, 1)
    innovations = [np.hstack([common, -2 * common, np.zeros((T, 1))]) + rng.normal(size=(T, 3))]
    assert together(innovations) == {0, 1}
    white = residues(innovations, np.ones(3))
    assert [r.structured for r in white] == [True, True, False]
    assert white[0].noise == pytest.approx(1.0, rel=0.02)


def test_noise_of_a_speed_derived_from_the_position_is_not_shared():
    position = np.random.default_rng(0).normal(size=T)
    speed = np.gradient(position)
    assert together([np.column_stack([position, speed])]) == set()


def test_records_are_taken_together():
    rng = np.random.default_rng(3)
    common = coloured(rng, 1)
    both = np.hstack([common, common])
    assert together([both[: T // 2], both[T // 2 :]]) == {0, 1}


def test_one_lost_stretch_does_not_hide_a_gain():
    rng = np.random.default_rng(0)
    before, after = (level * rng.normal(size=(T, 1)) for level in (3.0, 1.0))
    after[:100] += 200.0
    assert gain_on([before], [after], 50)[0] < 0
    gain, certainty, share = gain_in_blocks([before], [after], 50, np.ones(1))
    assert gain > 0
    assert certainty > 5
    assert 0.5 < share < 1.0
    assert gain_in_blocks([after], [before], 50, np.ones(1))[1] < -5


def test_no_gain_is_no_gain():
    certainties = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        before, after = rng.normal(size=(2, T, 1))
        certainties.append(gain_in_blocks([before], [after], 50, np.ones(1))[1])
    assert abs(np.mean(certainties)) < 0.5
    assert np.std(certainties) == pytest.approx(1.0, abs=0.35)


def test_steps_of_an_encoder_are_found_and_their_rounding_is_noise():
    t = np.arange(T) * 0.005
    smooth = 0.74 * t + 0.05 * np.sin(t)
    shown = 0.01 * np.round(smooth / 0.01)
    noisy = smooth + 0.003 * np.random.default_rng(0).normal(size=T)
    segment = Segment(t, np.zeros((T, 1)), np.column_stack([shown, noisy]), {}, "")
    assert quanta([segment]) == pytest.approx([0.01, 0.0])
    rounding = shown - smooth
    assert not whiteness([rounding]).white
    assert whiteness([rounding], steps=True).white
    assert not whiteness([rounding + 0.002 * np.sin(t)], steps=True).white


def test_what_lasts_too_long_is_structure_beyond_white_noise():
    rng = np.random.default_rng(3)
    noise, slow = rng.normal(0.0, 1.0, 4000), np.zeros(4000)
    for k in range(1, slow.size):
        slow[k] = 0.97 * slow[k - 1] + rng.normal(0.0, 0.5)
    (found,) = residues([(slow + noise)[:, None]], np.ones(1))
    assert found.coloured == 0.0
    assert found.noise == pytest.approx(1.0, rel=0.1)
    assert found.structured


def test_white_noise_that_was_thought_smaller_is_no_structure():
    noise = np.random.default_rng(4).normal(0.0, 1.0, (40_000, 1))
    (found,) = residues([noise], np.full(1, 0.95))
    assert not found.structured


@pytest.mark.parametrize("share", [0.02, 0.2])
def test_what_rings_is_no_noise(share):
    rng = np.random.default_rng(5)
    noise = rng.normal(0.0, 1.0, 8000)
    pole = 0.97 * np.exp(0.7j)
    ringing = lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], rng.normal(size=8000))
    ringing *= np.std(noise) / share / np.std(ringing)
    (found,) = residues([(ringing + noise)[:, None]], np.ones(1))
    assert found.structured
    assert found.noise < 3.0


def structured(samples, rho, share, draws):
    """Return how often noise of a colour, a share of whose variance lasts long, is said to have structure."""
    rng = np.random.default_rng(5)

    def noise(of):
        return lfilter([np.sqrt(1 - of**2)], [1, -of], rng.standard_normal(samples + 2000))[2000:]

    parts = (np.sqrt(1 - share) * noise(rho) + np.sqrt(share) * noise(0.99) for _ in range(draws))
    return np.mean([residue([part]).structured for part in parts])


def test_strongly_coloured_noise_seldom_seems_to_have_structure():
    assert structured(1600, 0.85, 0.0, 400) < 0.035


def test_structure_in_coloured_noise_is_seen():
    assert structured(3200, 0.7, 0.3, 100) > 0.9


@pytest.mark.parametrize("rho", [0.25, 0.32, 0.4])
def test_noise_of_little_colour_is_filtered_white(rho):
    """Colours of more than the whole variance, cut off afterwards, left one in six unfiltered."""
    for seed in range(100):
        part = coloured(np.random.default_rng(seed), 1, rho)[:1600, 0]
        first = residue([part]).filter
        assert abs(first - rho) < 0.15
        assert whiteness([part[1:] - first * part[:-1]]).white
