"""What is checked of a whole model: its axis, and the options that name states, inputs and parameters."""

from __future__ import annotations

import shlex
from collections import Counter
from typing import TYPE_CHECKING

from signlin_ros.apart import split
from signlin_ros.errors import ModelError, choices, suggest
from signlin_ros.model.uses import effect_class
from signlin_ros.names import TIME_NAMES
from signlin_ros.par import declared_name
from signlin_ros.recording.trace import TEMPERATURE

if TYPE_CHECKING:
    from signlin_ros.model.model import Model

WHOLE_ORDER_TOLERANCE = 1e-9
"""How far from a whole number an order may be that is called whole."""


def check_axis(model: Model) -> None:
    """Refuse a linear axis where the plant turns, and orders that are not whole where the axis does."""
    if model.axis == "linear" and model.plant.position_unit == "rad":
        raise ModelError(f"axis: found 'linear'; allowed: rotary, the plant {model.plant.name} turns")
    for key, use in model.effects.items() if model.is_rotary else ():
        whole = effect_class(use).whole_orders
        for name, order in ((n, v) for n, v in use.parameters.items() if declared_name(n) in whole):
            if min(abs(turns - round(turns)) for turns in (order, order / model.gear)) > WHOLE_ORDER_TOLERANCE * order:
                of_motor = f", or such a number times the gear {model.gear:g}" if model.gear != 1.0 else ""
                raise ModelError(
                    f"effects.{key}.{name}: found {order:g}; allowed: a whole number, the axis is rotary{of_motor}"
                )


def check_names(model: Model) -> None:
    """Check every option that names a state, an input or a parameter."""
    for name in model.with_inputs:
        optional = (*model.plant.optional_inputs, TEMPERATURE)
        if name not in optional:
            known = f"{choices(optional)}{suggest(name, optional)}"
            raise ModelError(f"with_inputs: {name!r} is no optional input of {model.plant.name}; there are: {known}")
    allowed = {"state_weights": model.states, "initial_state": model.states, "operating_range": None}
    for option, names in allowed.items():
        table: dict[str, float] = getattr(model, option)
        own = _own_names(option, {name: _state_name(model, option, name, names) for name in table})
        object.__setattr__(model, option, {own[name]: value for name, value in table.items()})
    _own_names("signals", {name: _signal_name(model, name) for name in model.signals})
    tolerances = model.tolerance if isinstance(model.tolerance, dict) else {}
    for option, given in (("frozen", model.frozen), ("tolerance", tolerances)):
        for name in given:
            if name not in model.parameters:
                known = f"{choices(model.parameters)}{suggest(name, model.parameters)}"
                raise ModelError(f"{option}: {name!r} is no base parameter; there are: {known}")
    for name in model.per_record:
        if name not in (free := [n.split(".", 1)[1] for n in model.par_declarations()]):
            raise ModelError(f"per_record: {name!r} is no parameter; there are: {choices(free)}{suggest(name, free)}")
        if name in model.frozen:
            raise ModelError(f"per_record: {name!r} is frozen, so that no fit may give it a value for each record")
    if model.sign_scale == 0.0 and not model.operating_range and model.plant.velocity:
        example = f"{{{model.plant.velocity}: 30.0}}"
        raise ModelError(f"operating_range: missing; sign_scale 0.0 is chosen from it, e.g. {example}")


def _own_names(option: str, own: dict[str, str]) -> dict[str, str]:
    """Return the own names by those given under an option; raise `ModelError` where two mean the same."""
    for plain, count in Counter(own.values()).items():
        if count > 1:
            given = " and as ".join(name for name, its in own.items() if its == plain)
            raise ModelError(f"{option}: {plain} is given twice, as {given}")
    return own


def _signal_name(model: Model, name: str) -> str:
    """Return the own name of what a record may hold: the time, a state, input or output, or what may be one."""
    if name in TIME_NAMES:
        return TIME_NAMES[0]
    file, own = split(name)
    if file:
        said = shlex.join(["--signal", f"{name}={model.signals[name]}"])
        raise ModelError(
            f"signals: {name!r}: a model file says what holds for every record ({own}); what holds for {file!r} alone"
            f" is said on the command line: {said}"
        )
    perhaps = name in (*model.plant.optional_inputs, *model.plant.sometimes, *model.parameters, TEMPERATURE)
    return name if perhaps else _state_name(model, "signals", name, None)


def _state_name(model: Model, option: str, name: str, allowed: tuple[str, ...] | None) -> str:
    try:
        plain = model.canonical(name)
    except ModelError as error:
        raise ModelError(f"{option}: {error}") from error
    if allowed is not None and plain not in allowed:
        raise ModelError(f"{option}: {name!r} is no state; there are: {', '.join(allowed)}")
    return plain


__all__ = ["WHOLE_ORDER_TOLERANCE", "check_axis", "check_names"]
