"""Changes in innovations: called soon, dated, and not called where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from signlin_ros.observe.detect import BLOCK_SECONDS, ChangeDetector

STEP = 0.005


def innovations(seconds: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    t = np.arange(0.0, seconds, STEP)
    return t, np.random.default_rng(seed).standard_normal(t.size)


@pytest.mark.parametrize("seed", range(4))
def test_white_noise_is_no_change(seed: int) -> None:
    detector = ChangeDetector()
    assert detector.take(*innovations(150.0, seed)) is None
    assert not detector.learning


@pytest.mark.parametrize("seed", range(4))
def test_larger_innovations_are_called_within_a_second_and_dated(seed: int) -> None:
    t, z = innovations(60.0, seed)
    z[t >= 45.0] *= 3.0
    alarm = ChangeDetector().take(t, z)
    assert alarm is not None
    assert 45.0 <= alarm.t < 46.0
    assert alarm.onset == pytest.approx(45.0, abs=2 * BLOCK_SECONDS)


def test_a_shift_is_called_at_once_and_one_wild_value_is_not() -> None:
    form = np.array([7.0, 2.0, -1.0, -2.5, -2.9, -2.6])  # what the shift leaves in a filter's innovations
    t, z = innovations(60.0, 5)
    z[8000:8006] += 2.0 * np.diff(form, prepend=0.0)  # a value that comes and goes
    assert ChangeDetector(signatures={0: form}).take(t, z) is None
    z[9000:9006] += form
    alarm = ChangeDetector(signatures={0: form}).take(t, z)
    assert alarm is not None
    assert alarm.kind == "shift"
    assert alarm.t == pytest.approx(45.0, abs=0.03)
    assert alarm.onset == pytest.approx(45.0, abs=STEP)


def test_what_was_unusual_before_is_no_shift() -> None:
    form = np.array([4.0, 1.5, 0.0, -1.0, -1.4, -1.5])
    t, z = innovations(60.0, 5)
    alarms = []
    for before in (0.0, 5.5):
        seen = z.copy()
        seen[8998:9000] += before  # a shaft that breaks away starts slowly
        seen[9000:9006] += 2.0 * form
        alarms.append(ChangeDetector(signatures={0: form}).take(t, seen))
    assert alarms[0] is not None
    assert alarms[0].kind == "shift"
    assert alarms[1] is None or alarms[1].kind == "change"


def test_a_shift_is_called_in_a_situation_that_was_seen_a_few_times_only() -> None:
    form = np.array([7.0, 2.0, -1.0, -2.5, -2.9, -2.6])
    t, z = innovations(60.0, 5)
    seldom = ((t % 6.0 < 0.3) & (t < 50.0)).astype(np.int64)
    z[8410:8416] += form  # at 42.05 s, in the eighth of them
    alarm = ChangeDetector(signatures={0: form}).take(t, z, seldom)
    assert alarm is not None
    assert alarm.onset == pytest.approx(42.05, abs=STEP)


def test_a_run_to_one_side_is_called_at_once_and_one_wild_value_is_not() -> None:
    t, z = innovations(60.0, 5)
    z[8000] = 30.0
    assert ChangeDetector().take(t, z) is None
    z[9000:9004] = [9.0, 7.0, 5.0, 4.0]
    alarm = ChangeDetector().take(t, z)
    assert alarm is not None
    assert alarm.t == pytest.approx(45.0, abs=0.03)


@pytest.mark.parametrize("seed", range(4))
def test_small_values_that_lean_to_one_side_are_called_and_dated(seed: int) -> None:
    t, z = innovations(60.0, seed)
    z[(t >= 45.0) & (t < 45.25)] += 1.5  # neither a run of large ones nor a large block
    alarm = ChangeDetector().take(t, z)
    assert alarm is not None
    assert 45.0 < alarm.t < 45.25
    assert alarm.onset == pytest.approx(45.0, abs=0.1)


def test_leaning_that_was_usual_is_no_change() -> None:
    t, z = innovations(60.0, 3)
    z[t % 5.0 < 0.2] += 1.2
    assert ChangeDetector().take(t, z) is None


def test_a_new_situation_is_learnt_before_anything_in_it_is_called() -> None:
    t, z = innovations(60.0, 6)
    new = t >= 45.0
    z[new] *= 3.0
    assert ChangeDetector().take(t, z, new.astype(np.int64)) is None
    often = (t % 2.0 < 0.5).astype(np.int64)  # seen while it was learnt, and larger in it
    z = innovations(60.0, 7)[1] * np.where(often == 1, 3.0, 1.0)
    assert ChangeDetector().take(t, z, often) is None


def test_pieces_of_any_length_give_the_same() -> None:
    t, z = innovations(60.0, 8)
    z[t >= 45.0] *= 2.5
    whole, pieces = ChangeDetector(), ChangeDetector()
    whole.take(t, z)
    for part in np.array_split(np.arange(t.size), 777):
        pieces.take(t[part], z[part])
    assert whole.alarm == pieces.alarm
