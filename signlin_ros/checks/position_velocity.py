"""Position and velocity that contradict each other."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from signlin_ros.checks.base import OfColumns, without_channel
from signlin_ros.checks.factors import word
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import Look
from signlin_ros.checks.travel import EQUAL, FACTOR_TOLERANCE, MIN_AGREEMENT, MIN_EXCESS_OVER_NOISE, Travel
from signlin_ros.checks.unit_or_sign import divided
from signlin_ros.records.clean import gaps
from signlin_ros.records.notes import as_notes
from signlin_ros.relative_lag import lag_of_samples

Array = NDArray[np.float64]

STRANGE = 0.5
"""Largest squared correlation where they have nothing to do with each other."""
MIN_SQUARED_CORRELATION = 0.99
"""Squared correlation by which both exceed their noise, however large that looks in few steps."""
MIN_LAG_SAMPLES = 1.0
"""Samples beyond which a lag is told: a difference of neighbours is half of one late."""


class PositionVelocity(OfColumns):
    """The velocity is not the rate of the position: another unit (57.3, 2 pi, 9.55, 60, 1000), a gear, a sign, a lag,
    or another axis; or it has an offset.

    Test: over stretches in which it moves most, gaps aside, the change of the position is regressed on the integral of
    the velocity; both exceed `MIN_EXCESS_OVER_NOISE` times what their noise does, or share `MIN_SQUARED_CORRELATION`
    of their variance, so that the factor is known to some per cent, and a clean record has 1. A factor counts beyond
    `EQUAL`, 10 of its standard errors or more. Cure: the conversion, a sign (``reverse_NAME``); a velocity of
    something else is left out (``leave_out_NAME``). A lag and an offset are noted.
    """

    name = "position_velocity"
    needs_time = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield a factor, a contradiction or a lag."""
        q, v = look.position, look.velocity
        if q not in look.channels or v not in (*look.channels, *look.record.inputs):
            return
        if ("derived", v) in {(note.kind, note.channel) for note in as_notes(look.record.notes)}:
            return  # it is the rate of the position
        found = look.travel
        if found is None or {q, v} & set(look.reported):
            return
        if found.offset and v in look.channels:
            offset = f"{abs(found.offset):.3g} {look.unit(v)} {'more' if found.offset > 0 else 'less'}"
            yield self.note(v, f"the {v} reads {offset} than the {q} changes: an offset of its sensor, or a drift")
        if found.clear < MIN_EXCESS_OVER_NOISE and found.correlation < MIN_SQUARED_CORRELATION:
            return
        if found.correlation < STRANGE and v in look.channels:
            yield self._strange(look, found)
        elif found.correlation > MIN_AGREEMENT and abs(found.factor - 1.0) > EQUAL:
            yield self._factor(look, found.factor)
        elif found.correlation > MIN_AGREEMENT:
            lag = _lag(look.record.t, look.of(q), look.of(v))
            if abs(lag) > MIN_LAG_SAMPLES * look.step:
                late, early = (v, q) if lag > 0 else (q, v)
                yield self.note(late, f"the {late} lags {abs(lag):.3g} s behind the {early}: a filter, or its way")

    def _strange(self, look: Look, found: Travel) -> Finding:
        q, v = look.position, look.velocity
        sentence = (
            f"the {v} has little to do with the {q} (they share {100 * found.correlation:.0f} % of their variance)"
        )
        return Finding(
            self.name,
            v,
            "refuse",
            sentence,
            cure=f"leave_out_{v}",
            remedy=f"the {v} is left out",
            action=without_channel(v),
        )

    def _factor(self, look: Look, factor: float) -> Finding:
        q, v = look.position, look.velocity
        if abs(factor + 1.0) < EQUAL:
            words, cure, by, severity = "has the opposite sign of", f"reverse_{v}", {v: -1.0}, "offer"
        else:
            words, cure, by = _unit(look, factor)
            severity = "offer" if cure.startswith("scale") else "refuse"
        return Finding(
            self.name,
            v,
            severity,
            f"the {v} {words} the {q}'s rate",
            cure=cure,
            remedy="it is taken so",
            columns=True,
            action=divided(by),
        )


def _unit(look: Look, factor: float) -> tuple[str, str, dict[str, float]]:
    """Return words, cure and divisors for a factor of the velocity over the position's rate."""
    q, v = look.position, look.velocity
    turned = factor < 0
    size, ending, sign = abs(factor), "_reversed" if turned else "", -1.0 if turned else 1.0
    for name, inverse in ((v, False), (q, True)):
        for unit, times in look.others(name).items():
            wanted = 1.0 / times if inverse else times
            if abs(size / wanted - 1.0) < FACTOR_TOLERANCE:
                words = f"is {factor:.4g} times what it should be if the {name} is not in {unit}, going by"
                return words, f"{name}_in_{word(unit)}{ending}", {name: sign * times}
    return f"is {factor:.4g} times (a gear, or a unit)", f"scale_{v}", {v: factor}


def _lag(t: Array, q: Array, v: Array) -> float:
    """Return by how many s v lags behind the rate of q, in the longest stretch without a gap."""
    there = np.isfinite(q) & np.isfinite(v)
    t, q, v = t[there], q[there], v[there]
    first, last = max(pairwise(gaps(t)), key=lambda ends: ends[1] - ends[0])
    return lag_of_samples(t[first:last], q[first:last], v[first:last]) if last - first > 1 else 0.0
