"""What a servo says of its own loop's output, held against its gain and its error."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from statistics import median
from typing import NamedTuple

import numpy as np

from signlin_ros.checks.base import Check
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look

FOLLOWS, MAX_APART = 0.9, 0.15
"""Part of its square that the output must follow the loop's error by; by how much of it records may differ."""


class Output(NamedTuple):
    """A recorded output of a loop: the part of its square that follows from the error, and what full duty is in it."""

    name: str
    explained: float
    full: float


class LoopOutput(Check):
    """A servo's log holds what its loop puts out (BAM's ``load``): it must be the gain times the error.

    Test: duty = clip(duty_per_error kp (goal - position), ±duty_limit) explains `FOLLOWS` of the output's square, and
    what full duty is in it differs from record to record by `MAX_APART` at most: it is a number of the firmware's,
    whatever the gain is. Twelve logs of an XL-330 have 852 to 886, the firmware's 885, and 0.999 of the square. A loop
    with an integral or a derivative gain is not looked at. Cure: none; say the gain (--set FILE:kp=...). The output is
    never an input: what a servo measures of its effort explains everything.
    """

    name = "loop_output"
    needs_time = True

    def find(self, look: Look) -> Iterable[Finding]:
        """Yield the gains that one record shows."""
        return self.find_each([look])[0]

    def find_each(self, looks: Sequence[Look]) -> list[list[Finding]]:
        """Return findings on the gains of records, each beside all."""
        found = [_output(look) for look in looks]
        sizes = [one.full for one in found if one and one.explained >= FOLLOWS]
        usual = median(sizes) if sizes else 0.0
        return [
            [self._said(look, one, usual, len(sizes))] if one else [] for look, one in zip(looks, found, strict=True)
        ]

    def _said(self, look: Look, one: Output, usual: float, count: int) -> Finding:
        kp, part = look.model.parameters["kp"], f"{100 * one.explained:.3g} % of its square"
        if one.explained < FOLLOWS:
            asked = f"the gain {kp:g} times the error explains {part} only"
            return self.note(one.name, f"{one.name} is not what the loop puts out: {asked}; it is not used")
        fits = f"{one.name} is the gain {kp:g} times the error ({part}), {one.full:.3g} of it full duty"
        if count > 1 and abs(one.full / usual - 1.0) > MAX_APART:
            other = f"{fits}, in most records {usual:.3g}: the gain is rather {kp * one.full / usual:.3g}"
            return Finding(self.name, one.name, "offer", f"{other}; say which it is: --set FILE:kp=...")
        return self.note(one.name, fits)


def _output(look: Look) -> Output | None:
    """Return the output that a record holds; None where it holds none, or the loop has more than one gain."""
    p, r, plant = look.model.parameters, look.record, look.model.plant
    name = next((n for n in plant.beside if n in r.beside), "")
    if not name or r.beside[name].shape != r.t.shape or plant.position not in r.measured:
        return None
    if p["ki"] or p["kd"] or p["profile_time"]:
        return None
    error = r.u[:, r.inputs.index("goal_position")] - r.measured[plant.position]
    duty = np.clip(p["duty_per_error"] * p["kp"] * error, -p["duty_limit"], p["duty_limit"])
    if "torque_enable" in r.inputs:
        duty = duty * (r.u[:, r.inputs.index("torque_enable")] > 0.0)
    there = np.isfinite(duty) & np.isfinite(r.beside[name])
    duty, shown = duty[there], r.beside[name][there]
    size, own = float(duty @ duty), float(shown @ shown)
    if not size or not own:
        return None
    full = float(duty @ shown) / size
    return Output(name, 1.0 - float(np.sum((shown - full * duty) ** 2)) / own, full)


__all__ = ["LoopOutput"]
