"""Dry friction that falls with speed, looked for in the widest band: at a reversal it is there for a short time only.

The band of a record is that of its motion. In it a fall of friction over a few hundredths of the fastest speed is
spread over many rows beside viscous friction and bodies, which need no wider band.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from signlin_ros.arms.ahead import ahead, witnesses
from signlin_ros.arms.keys import SearchResult
from signlin_ros.arms.laws import BY_EFFECT
from signlin_ros.arms.piece import widest_band
from signlin_ros.arms.search import State, search
from signlin_ros.arms.study import Study

FALLS = "coulomb_friction"
"""What laws of reversals take the place of."""


def band_of_reversals(found: Study, state: State, progress: Callable[[str], None]) -> float | None:
    """Return the widest band (Hz), if a law of reversals stands in it that the model's file has not; else None.

    It stands as other laws do, and short forward simulations of unseen motion must not contradict it: other things
    happen at reversals, too.
    """
    band = widest_band([*found.runs[0], *found.runs[1]])
    if band <= found.band or state.barred >= set(range(state.robot.n)):
        return None
    progress(f"reversals, below {band:g} Hz")
    wide = replace(found, band=band).with_motors(state.rows.pieces[0].motors[: state.robot.n])
    again = [law.key for law in state.found if of_reversals(law)]
    terms = [(key, law) for key, law in state.terms if key not in again]
    own = replace(state, rows=wide.rows, new=wide.new, terms=terms, found=[], lumped=0.0, asked=FALLS)
    estimate = search(own)
    if not own.found:
        return None
    laws = [(law.key.at, law.names) for law in own.found]
    said = witnesses(own, estimate, ahead(own, estimate), laws)
    return band if any(one is None or one.says != "in question" for one in said) else None


def of_reversals(law: SearchResult) -> bool:
    """Tell whether a law is one of reversals."""
    return law.key.law in BY_EFFECT and BY_EFFECT[law.key.law].base == FALLS


__all__ = ["band_of_reversals", "of_reversals"]
