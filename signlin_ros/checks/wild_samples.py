"""Single samples that are far from their neighbours."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.base import Check, set_to, with_channel, without_samples
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look
from signlin_ros.checks.reached import never_reached
from signlin_ros.records import ModelData
from signlin_ros.records.inputs import filled_in
from signlin_ros.records.notes import as_notes
from signlin_ros.records.outliers import wild, wild_inputs
from signlin_ros.records.slope import rate_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MAX_SHOWN_TIMES = 3
"""Times that are told."""


class WildSamples(Check):
    """Single samples of a position, a velocity, another state, a measured force or an input lie far from their
    neighbours, which agree: lost readings, a sensor that slips where it passes zero, a number cut in two.

    Test: what has inertia, or a winding's current, does not leave its way for one sample or two and come back; a few
    that are beyond noise and beyond whatever else the record does, or more that depart three times further than any
    peak of the motion (`signlin_ros.records.outliers`). None is found in the shared records of real machines. An input
    may do that, a hammer does: there the motion must show that it has not driven the machine (`never_reached`). Cure:
    these samples are left out, of an input replaced from those beside them, before anything else is looked at: squares
    let one outweigh thousands, and the other channel would be blamed. A velocity that is the rate of such a position is
    worked out anew.
    """

    name = "wild_samples"

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield the channels that have such samples, then the inputs."""
        inert = (look.position, look.velocity)
        names = dict.fromkeys((*inert, *look.record.states, *look.channels))
        for name in (n for n in names if n in look.channels):
            off = wild(look.record, name, inert=name in inert)
            if off.any():
                yield self._finding(look, name, off, _left_out(look, name, off), ("it is", "they are"), "left out")
        for name in (n for n in look.record.inputs if n not in look.reported and not _derived(look.record, n)):
            off = wild_inputs(look.t, look.of(name))
            off = never_reached(look, name, filled_in(look.t, look.of(name), off)[0])[0] if off.any() else off
            if off.any():
                filled, between = filled_in(look.t, look.of(name), off)
                what = "taken from the line between its neighbours" if between else "taken as the value before it"
                yield self._finding(look, name, off, set_to(look, name, filled), ("it is", "each is"), what)

    def _finding(
        self,
        look: Look,
        name: str,
        off: Mask,
        action: Callable[[ModelData], ModelData],
        subject: tuple[str, str],
        remedy: str,
    ) -> Finding:
        values, times = look.of(name)[off], look.t[off]
        when = ", ".join(f"{t:.6g}" for t in times[:MAX_SHOWN_TIMES]) + (
            ", ..." if times.size > MAX_SHOWN_TIMES else ""
        )
        most = f"up to {values[int(np.argmax(np.abs(values)))]:.4g} {look.unit(name)}"
        one = times.size == 1
        lies, what = ("lies far from its", "a lost reading") if one else ("lie far from their", "lost readings")
        still = ", and the motion does not follow" if name in look.record.inputs else ""
        sentence = f"{times.size} of {off.size} samples {lies} neighbours, which agree ({most}){still}, at t = {when} s"
        return Finding(
            self.name,
            name,
            "note",
            f"the {name}: {sentence}: {what}",
            cure=f"drop_outliers_{name}",
            remedy=f"{subject[0 if one else 1]} {remedy}",
            harmless=True,
            action=action,
        )


def _derived(record: ModelData, name: str) -> bool:
    """Tell whether an input is the rate of the position."""
    return any((note.kind, note.channel) == ("derived", name) for note in as_notes(record.notes))


def _left_out(look: Look, name: str, off: Mask) -> Callable[[ModelData], ModelData]:
    """Return the cure that leaves samples (T,) of a channel out; a velocity that is its rate is worked out anew."""
    rate = look.velocity
    if name != look.position or rate not in look.record.inputs or not _derived(look.record, rate):
        return without_samples(look, (name,), off)

    def cure(record: ModelData) -> ModelData:
        rest = without_samples(look, (name,), off)(record)
        effort = next((rest.measured[n] for n in look.model.outputs if n in rest.measured and n != name), None)
        good = np.isfinite(rest.measured[name])
        found = rate_of(rest.t[good], rest.measured[name][good], None if effort is None else effort[good])[0]
        return with_channel(rest, rate, np.interp(rest.t, rest.t[good], found))

    return cure


__all__ = ["WildSamples"]
