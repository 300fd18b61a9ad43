"""Checks of what an effect declares, so that a slip of the pen is told when its file is loaded."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Iterable, Mapping
from string import Formatter
from typing import Any

from signlin_ros import units
from signlin_ros.effects.base import CHANNEL_UNIT, COORDINATE_UNIT, Effect, SensorEffect, Shown
from signlin_ros.errors import ModelError, choices, joined, nearest, suggest
from signlin_ros.par import POWER_DIGITS, declared_name, gathered, nominal_values
from signlin_ros.scale import Scale

LAW_METHODS = ("force", "input", "delay", "spring", "torque_constant", "resistance")
"""Methods of which an effect that does anything defines one."""
LISTS, MAPPINGS = ("essential", "turning", "periodic", "whole_orders"), ("held", "within")
"""Attributes that name parameters."""
SLIPS = (AttributeError, IndexError, KeyError, NameError, TypeError)
"""What a slip of the pen in a method raises; anything else may come of the numbers that it is tried with."""
_SCALE = Scale(1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.01, 10.0, 1.0)


def check_declared(effect: type[Effect], where: str) -> None:
    """Raise `ModelError` naming class and attribute where an effect defines no law, or declares what cannot be."""
    where = f"{where}: class {effect.__name__}"
    _check_law(effect, where)
    for name, unit in [*((n, p.unit) for n, p in effect.pars().items()), *effect.states.items()]:
        _check_unit(f"{where}: {name}", unit)
    _check_finding(effect, f"{where}: finding")
    _check_start(effect, f"{where}: start")
    for name in (*LISTS, *MAPPINGS):
        _check_names(effect, f"{where}: {name}", getattr(effect, name), name in MAPPINGS)
    _check_methods(effect, where)


def _check_law(effect: type[Effect], where: str) -> None:
    base, laws = (SensorEffect, ("sensor",)) if issubclass(effect, SensorEffect) else (Effect, LAW_METHODS)
    if any(getattr(effect, law) is not getattr(base, law) for law in laws):
        return
    own = (name for name, value in inspect.getmembers(effect, callable) if not hasattr(base, name))
    slips = ((name, nearest(name, laws)) for name in own)
    hint = next((f"; did you mean {law!r} by {name!r}?" for name, law in slips if law), "")
    raise ModelError(f"{where} defines no {joined(laws, 'or')}{hint}")


def _check_unit(where: str, unit: Any) -> None:
    """Refuse a unit that is not made of F, Q, U and units of records."""
    parts = re.split("[·/]", unit) if isinstance(unit, str) else [""]
    bare = [part.rstrip(POWER_DIGITS) for part in parts]
    if unit not in ("", CHANNEL_UNIT, COORDINATE_UNIT) and not all(
        part in ("F", "Q", "U") or units.parse(part) for part in bare
    ):
        allowed = "F, Q, U, and units such as s, m, rad, kg, N, A, V, Ohm, K, W and - with · and / between them"
        raise ModelError(f"{where}: the unit is {unit!r}; allowed: {allowed}, powers as in s²")


def _check_finding(effect: type[Effect], where: str) -> None:
    """Refuse a template that cannot be filled in."""
    if not isinstance(effect.finding, str):
        raise ModelError(f"{where}: found {effect.finding!r}; allowed: a sentence")
    pars = effect.pars()
    given = {n: Shown(v, pars[n].unit) for n, v in nominal_values(pars).items() if not pars[n].free_standing}
    values: dict[str, Any] = gathered(given)
    known = [word for name in {**given, **values} for word in (name, f"{name}.unit")]
    values |= {"F": "force", "Q": "position", "V": "velocity"}
    known += ["F", "Q", "V"]
    if issubclass(effect, SensorEffect):
        values = {"channel": "speed", "value": 1.0, "unit": "rad/s"}
        known = list(values)
    try:
        for _, word, _, _ in Formatter().parse(effect.finding):
            if word is not None and word not in known:
                raise ModelError(f"{where}: there is no {{{word}}}; there are: {choices(known)}{suggest(word, known)}")
        effect.finding.format(**values)
    except (ValueError, TypeError) as error:
        if isinstance(error, ModelError):
            raise
        raise ModelError(f"{where}: {error}; allowed: text, and {{...}} around {choices(known)}") from error


def _check_start(effect: type[Effect], where: str) -> None:
    example = f"({{{next(iter(effect.pars()), 'mu')!r}: 0.05}},)"
    if not isinstance(effect.start, (list, tuple)) or not all(isinstance(one, Mapping) for one in effect.start):
        raise ModelError(f"{where}: found {effect.start!r}; allowed: a tuple of mappings such as {example}")
    for one in effect.start:
        _check_known(effect, where, one)
        for name, value in one.items():
            if not _is_number(value):
                raise ModelError(f"{where}: {name}: found {value!r}; allowed: a finite number")


def _check_names(effect: type[Effect], where: str, given: Any, mapping: bool) -> None:
    kind, example = (Mapping, "mapping by parameter") if mapping else ((list, tuple), "tuple of parameters")
    if not isinstance(given, kind):
        raise ModelError(f"{where}: found {given!r}; allowed: a {example}")
    _check_known(effect, where, given)


def _check_known(effect: type[Effect], where: str, names: Iterable[Any]) -> None:
    pars = effect.pars()
    for name in names:
        if declared_name(str(name)) not in pars:
            raise ModelError(f"{where}: no parameter {name!r}; there are: {choices(pars)}{suggest(str(name), pars)}")


def _check_methods(effect: type[Effect], where: str) -> None:
    """Call what a diagnosis calls, with parameters of the size that is declared."""
    pars = effect.pars()
    p = {name: pars[name].nearest(value or 1.0) for name, value in nominal_values(pars).items()}
    tried: dict[str, tuple[Any, ...]] = {
        "starts": (_SCALE,),
        "after": ("", p),
        "simpler": (p,),
        "plausible": (p,),
    }
    for name, arguments in tried.items():
        try:
            found = getattr(effect, name)(*arguments)
        except SLIPS as error:
            raise ModelError(f"{where}: {name} fails: {type(error).__name__}: {error}") from error
        except ArithmeticError:
            continue
        for point in found if name == "starts" else ():
            _check_known(effect, f"{where}: starts", point)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


__all__ = ["check_declared"]
