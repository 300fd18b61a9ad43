"""Samples too far apart for the model's fastest motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from signlin_ros.checks.base import Check
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.linear import Base
from signlin_ros.checks.look import Look
from signlin_ros.checks.unit_or_sign import MAX_GOOD_RESIDUAL
from signlin_ros.records import ModelData
from signlin_ros.records.table import frozen
from signlin_ros.scale import MAX_STEP_OVER_TIME_CONSTANT

MAX_RESIDUAL_PART = 0.9
"""What inputs that change in between leave of the record, as a part of what inputs that are held leave, at most:
records of either kind lie at 0.62 to 0.81 and at 1.26 to 1.47."""


class SlowSampling(Check):
    """The samples are too far apart for the model's fastest motion.

    Test: a step is more than `MAX_STEP_OVER_TIME_CONSTANT` of its time constants, by the model's own numbers; nothing
    is left to chance.
    Cure: none; what only that motion tells is not known from this record. If even the slowest motion is over between
    two samples, and the model does not follow the record from rest to rest, as a valve on its spring in a slow log, it
    is refused: the time is in another unit, or, where that was said, the model's parameters are not the machine's.
    Where the model follows the
    record better with inputs that change evenly from one sample to the next, they may have been sampled from what went
    on in between: ``input_between`` lets each act from half a step before its sample, as ``input_hold: centred`` does.
    """

    name = "slow_sampling"
    needs_time = True

    def find(self, look: Look) -> Iterator[Finding]:
        """Yield one finding for the record."""
        if look.base is None or look.step <= 0.0:
            return
        sizes = look.base.rates
        moving = sizes > 1e-6 * sizes.max(initial=0.0)
        if not moving.any():
            return
        fast, slow = 1.0 / sizes[moving].max(), 1.0 / sizes[moving].min()
        if look.step > MAX_STEP_OVER_TIME_CONSTANT * slow:
            sentence = f"a sample every {look.step:.3g} s, while the model's slowest motion takes {slow:.3g} s"
            if look.predicted is not None and look.predicted.left() < MAX_GOOD_RESIDUAL:
                yield self.note("t", f"{sentence}: only forces at rest are known from this record")
            else:
                yield Finding(self.name, "t", "refuse", f"{sentence}{_asked(look)}")
        elif look.step > MAX_STEP_OVER_TIME_CONSTANT * fast:
            state = _fastest_state(look.base, look.model.states)
            sentence = (
                f"a sample every {look.step:.3g} s is too slow for the model's fastest motion ({fast:.2g} s, of the"
                f" {state}): what happens in between is not known from this record"
            )
            yield _between(sentence) if _goes_on(look) else self.note("t", sentence)


def _asked(look: Look) -> str:
    """Return the questions of the check: the unit of the time, unless it is known, and the model's parameters."""
    known = any(getattr(note, "kind", "") == "clock" for note in look.record.notes)
    values = ", ".join(f"{name} = {value:g}" for name, value in look.model.parameters.items() if value)
    own = f"are the model's parameters the machine's, {values}?"
    if known:
        return f": {own} If so, only a record with shorter steps tells of its motion"
    return f": is the time in another unit? Name it, as t [ms]; if it is not, {own}"


def _between(sentence: str) -> Finding:
    better = "; the model follows it better if the inputs change from one sample to the next"
    remedy = "each input acts from half a step before its sample"
    return Finding(
        "slow_sampling", "t", "offer", sentence + better, cure="input_between", remedy=remedy, action=_centred
    )


def _centred(record: ModelData) -> ModelData:
    """Return a record whose inputs act from half a step before their samples."""
    acts = record.t if record.acts is None else record.acts
    return replace(record, acts=frozen(acts - 0.5 * float(np.median(np.diff(record.t)))))


def _goes_on(look: Look) -> bool:
    """Tell whether the model follows the record better with inputs that change evenly between their samples."""
    held = look.resisted
    if held is None or not look.model.asks_hold or look.model.plant.motion_is_imposed():
        return False
    u = look.record.u.copy()
    u[:-1] = 0.5 * (u[:-1] + u[1:])
    other = Look(look.model, replace(look.record, u=frozen(u))).resisted
    return other is not None and other.left() < MAX_RESIDUAL_PART * held.left()


def _fastest_state(base: Base, states: tuple[str, ...]) -> str:
    """Return the state that takes most part in the fastest motion."""
    rates, vectors = np.linalg.eig(base.A)
    k = int(np.argmax(np.abs(rates)))
    return states[int(np.argmax(np.abs(vectors[:, k] * np.linalg.pinv(vectors)[k])))]
