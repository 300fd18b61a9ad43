"""Forces of several waves over the position, told by the motion, from an independent program."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.hidden.generator import draw, write
from signlin_ros.diagnosis import add, diagnose
from signlin_ros.effects import EFFECTS
from signlin_ros.follow.data import load_sides
from signlin_ros.model import Model
from tests.diagnosis.test_hidden_effects import halved


def _drawn(index: int, seed: int, folder: Path):
    one = draw("catalogue", index, seed)
    written = write(one, folder)
    known, unseen = ([written / f"{name}.csv"] for name in ("estimation", "validation"))
    return load_sides(Model.load(written / "model.yaml"), known, unseen), one.truth["values"]["torque_ripple"]


@pytest.mark.parametrize(("index", "seed"), [(77, 3), (78, 6)])
def test_two_waves_are_named_together(tmp_path, index, seed):
    """77: a slide, whose orders are no whole numbers. 78: a motor, with coloured noise."""
    sides, truth = _drawn(index, seed, tmp_path)
    found = diagnose(*(halved(*sides) if index == 78 else sides))
    assert found.verdict == "missing"
    assert [one.effect for one in found.ranking if one.status == "confirmed"] == ["torque_ripple"]
    ripple = found.model.effects["torque_ripple"].parameters
    waves = sorted(EFFECTS["torque_ripple"].waves(ripple))
    assert [order for order, _, _ in waves] == pytest.approx([truth["N"], truth["N_2"]], rel=2e-3)
    assert [abs(a) for _, a, _ in waves] == pytest.approx([truth["A"], truth["A_2"]], rel=0.08)


def test_what_is_asked_for_is_found_wave_by_wave_too(tmp_path):
    """What forces below a band show of the waves was taken for all of them: "the record does not ask for it"."""
    sides, truth = _drawn(78, 5, tmp_path)
    found = add("torque_ripple", *sides)
    assert found.verdict == "missing"
    waves = sorted(EFFECTS["torque_ripple"].waves(found.model.effects["torque_ripple"].parameters))
    assert [order for order, _, _ in waves] == [truth["N"], truth["N_2"]]


def test_the_sum_of_waves_that_have_not_repeated_may_be_any_curve(tmp_path):
    """The record holds 0.6 periods of the longer of two waves: both are found, and not named, nor is another law that
    takes away a part.
    """
    sides, _ = _drawn(77, 5, tmp_path)
    found = diagnose(*halved(*sides))
    assert found.verdict == "unexplained"
    assert not [one for one in found.ranking if one.status in ("confirmed", "ambiguous")]
    assert (
        "torque ripple would leave nothing but noise, but the records hold 0.6 periods of torque_ripple"
        in found.sentence
    )
