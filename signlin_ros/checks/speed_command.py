"""A commanded speed that is taken for a force or a voltage."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from signlin_ros import units
from signlin_ros.checks.base import OfRecordsTogether
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.checks.observer import Together
from signlin_ros.checks.tracking import stated, strictness, tracks

MAX_LEFT = 0.4
"""What the model leaves of a record whose input is what it is said to be, as a share of what it leaves without any."""
OWN_GAIN = 2.0
"""Within this factor of it an input's own number is what the model itself leads to: then it is believed."""


class SpeedCommand(OfRecordsTogether):
    """The input is the set point of a speed loop: the velocity settles at the input's own number, in some unit.

    Test: as of a commanded position (`signlin_ros.checks.position_command`), of the velocity; and the model, driven by
    such a force or voltage, would come to a velocity that is `OWN_GAIN` times as large, or as small, at least. Where
    only the velocity in another unit is that number, the model must not follow the record besides: friction holds a
    force in proportion to a speed that seldom changes, and of many units one fits. A column
    whose unit is that of a force, or that is called one, is believed unless its number is exactly the velocity's. By
    chance none: the velocity has to follow a number that has nothing to do with it to 5 % of its square.
    Cure: none; the current or the voltage has to be recorded.
    """

    name = "speed_command"
    needs_time = True
    needs_input = True

    def found(self, looks: Sequence[Look]) -> Iterator[Finding]:
        """Yield the input, where it is such a command."""
        look = looks[0]
        model, v = look.model, look.velocity
        usable = [one for one in looks if v in one.channels and one.t.size >= MIN_SAMPLES]
        if not usable or model.plant.motion_is_imposed() or model.plant.closed_loop or not look.record.inputs:
            return
        name = look.record.inputs[0]
        if units.conversion(model.units[name], model.units[v]) is not None or stated(look, name):
            return
        own = _steady_gain(look)
        pairs = [(one, np.nan_to_num(one.of(name)), one.of(v)) for one in usable]
        others = {} if _explained(usable) else look.others(v)
        for unit, times in {"": 1.0, **others}.items():
            if 1.0 / OWN_GAIN < own * times < OWN_GAIN:
                continue
            if tracks([(one, u / times, x) for one, u, x in pairs], strictness(look, name)):
                yield self._finding(look, name, unit)
                return

    def _finding(self, look: Look, name: str, unit: str) -> Finding:
        v, inside = look.velocity, f" in {unit}" if unit else ""
        label = look.record.labels.get(name, name)
        sentence = (
            f"the {v} settles at the number of the {name} (column {label!r}){inside}: this is a commanded speed, not "
            f"the {name}; the loop that follows it hides what a {name} does. Record what drives: the current, the "
            "torque or the voltage at the motor"
        )
        return Finding(self.name, name, "refuse", sentence, columns=True)


def _explained(looks: Sequence[Look]) -> bool:
    """Tell whether the model follows records by what the inputs do, beside dry friction and a load of any size."""
    known = [one.resisted for one in looks if one.resisted is not None]
    together = Together.of(known) if known else None
    undriven = dict.fromkeys(looks[0].record.inputs, 0.0)
    return together is not None and together.left() < MAX_LEFT * together.left(undriven)


def _steady_gain(look: Look) -> float:
    """Return the velocity at which a model rests for a unit of its first input, without dry friction; infinite where it
    would never rest.
    """
    base = look.base
    if base is None or look.velocity not in base.states:
        return np.inf
    kept = [k for k, name in enumerate(base.states) if name != look.position]
    A, b = base.A[np.ix_(kept, kept)], base.B[kept, 0]
    try:
        rest = -np.linalg.solve(A, b)
    except np.linalg.LinAlgError:
        return np.inf
    return float(abs(rest[[base.states[k] for k in kept].index(look.velocity)]))


__all__ = ["SpeedCommand"]
