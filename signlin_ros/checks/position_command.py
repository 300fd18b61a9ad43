"""A commanded position that is taken for a force or a voltage."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from signlin_ros import units
from signlin_ros.checks.base import OfRecordsTogether
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.checks.tracking import proportion, stated, strictness, tracks
from signlin_ros.records.converted import quoted
from signlin_ros.records.grammar import is_formula, split_unit
from signlin_ros.records.header import heading

Array = NDArray[np.float64]

COMMAND_UNITS = {"": 1.0, "degrees": 57.29577951308232, "turns": 0.15915494309189535}
"""What a commanded angle is in, and how many of it a rad is."""


class PositionCommand(OfRecordsTogether):
    """The input is a position that was commanded, since nothing else was recorded of a servo: the position settles at
    the input's own number.

    Test: with a lag and a delay the input's number itself is the position to `signlin_ros.checks.tracking` allows; or
    at the ends of steps that are held the position rests, goes with the input, and is most of it. A force that acts on
    a mass leads to neither; a spring of the stiffness 1 would, so that a model which has a spring is believed, and a
    column whose unit is that of a force or that is called one is believed unless its number is exactly the position's.
    Of a column that nothing calls a force any proportion counts, to a fifth of these limits: pulses of a servo in µs.
    Cure: none; the plant `servo` takes a position for its input.
    """

    name = "position_command"
    needs_time = True

    def found(self, looks: Sequence[Look]) -> Iterator[Finding]:
        """Yield the input, where it is such a command."""
        look = looks[0]
        model, q = look.model, look.position
        usable = [one for one in looks if q in one.channels and one.t.size >= MIN_SAMPLES]
        if not usable or model.plant.motion_is_imposed() or not look.record.inputs:
            return
        name = look.record.inputs[0]
        if units.conversion(model.units[name], model.units[q]) is not None or _restored(look) or stated(look, name):
            return
        pairs = [(one, np.nan_to_num(one.of(name)), one.of(q)) for one in usable]
        strict = strictness(look, name)
        for unit, times in COMMAND_UNITS.items():
            scaled = [(one, u / times, x) for one, u, x in pairs]
            if tracks(scaled, strict):
                yield self._finding(look, name, unit)
                return
        gain = proportion(pairs) if strict == 1.0 else None
        if gain is not None:
            yield self._proportional(look, name, gain)

    def _finding(self, look: Look, name: str, unit: str) -> Finding:
        q, inside = look.position, f" in {unit}" if unit else ""
        label = look.record.labels.get(name, name)
        sentence = (
            f"the {q} settles at the number of the {name} (column {label!r}){inside}: this is a commanded position, "
            f"not the {name}; what a {name} does cannot be told from it. Record what drives (the current, the torque), "
            "or model the servo as one: plant servo, input goal_position, where `signlin plants` lists it"
        )
        return Finding(self.name, name, "refuse", sentence, columns=True)

    def _proportional(self, look: Look, name: str, gain: float) -> Finding:
        q, label = look.position, look.record.labels.get(name, name)
        unit = look.unit(name)
        sentence = (
            f"the {q} is, or settles at, {gain:.3g} times the number of the {name} (column {label!r}), which nothing "
            f"calls a {name}: a commanded position in units of its own, or a spring that the model lacks. Where it is "
            f"a {name}, say so: --signal '{name} = {_said(label)} [{unit}]'; else record what drives (the current, the "
            "torque), or model the servo as one: plant servo, input goal_position"
        )
        return Finding(self.name, name, "refuse", sentence, columns=True)


def _said(label: str) -> str:
    """Return a column's name, or a formula, without its unit, as a mapping takes it."""
    body = split_unit(label)[0]
    return body if is_formula(body) else quoted(heading(body).name)


def _restored(look: Look) -> bool:
    """Tell whether the model itself pulls the position back, so that it follows a force."""
    base = look.base
    if base is None or look.position not in base.states or look.velocity not in base.states:
        return False
    return bool(base.A[base.states.index(look.velocity), base.states.index(look.position)] != 0.0)


__all__ = ["PositionCommand"]
