"""Asking an effect for its law: what is wrong in somebody's code is said in one line, with its file and method."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import casadi as ca

from signlin_ros.effects import Effect, origin
from signlin_ros.errors import EffectError, InputError, ModelError, choices, suggest
from signlin_ros.mathops import VOCABULARY, Math
from signlin_ros.par import Namespace
from signlin_ros.plants import PLANTS, Plant

COORDINATES = {"position", "velocity", "drive_force", "external_force", "resistance", "temperature"}.union(
    *(plant.states(dict.fromkeys(plant.pars(), 1.0)) for plant in PLANTS.values())
)
"""What an effect may ask of some plant; another word is a slip of the pen."""


def asked(effect: Effect, method: str, plant: type[Plant], *arguments: Any) -> Any:
    """Return the value of an effect's method, checked.

    Raises `EffectError` where its code fails or returns what is no expression, `ModelError` where the plant has not
    what it asks for.
    """
    where = f"{origin(type(effect))}: {effect.name}: {method}"
    try:
        found = getattr(effect, method)(*arguments)
    except AttributeError as error:
        absent = ModelError(f"effects: {effect.name} does not apply to plant {plant.name}: it has no {error.name}")
        raise _absent(where, arguments, error) or absent from error
    except InputError:
        raise
    except Exception as error:
        raise EffectError(f"{where} fails: {_said(error)}") from error
    if method == "rates":
        _check_rates(effect, where, found)
    elif not (method == "spring" and found is None):
        _check(where, found)
    return found


def _absent(where: str, arguments: Sequence[Any], error: AttributeError) -> EffectError | None:
    """Return the error for a misspelt word of the vocabulary, parameter or coordinate; None for one of other plants."""
    name, owner = str(error.name or error), error.obj
    if isinstance(owner, Math):
        return EffectError(_unknown(where, f"m.{name}", VOCABULARY, name))
    if isinstance(owner, Namespace):
        kind = "x.own" if any(getattr(a, "own", None) is owner for a in arguments) else "p"
        return EffectError(_unknown(where, f"{kind}.{name}", vars(owner), name))
    if isinstance(owner, ca.SX) or not any(a is owner for a in arguments):
        return EffectError(f"{where} fails: {_said(error)}")
    return None if name in COORDINATES else EffectError(_unknown(where, f"x.{name}", COORDINATES, name))


def _unknown(where: str, word: str, known: Iterable[str], name: str) -> str:
    names = list(known)
    return f"{where}: there is no {word}; there are: {choices(names)}{suggest(name, names)}"


def _said(error: Exception) -> str:
    """Return an exception's message; one of treating a symbol as a number says what to do instead."""
    text = " ".join(str(error).split())
    if "truth value" in text:
        return f"x and p are symbols, on which if, and, or, min and max cannot decide; {_INSTEAD}"
    return f"{type(error).__name__}: {text[:200]}"


_INSTEAD = f"write the law with {', '.join(f'm.{word}' for word in VOCABULARY)}"


def _check(where: str, found: Any) -> None:
    """Refuse what is no scalar expression, and what holds a number that is none (``math.tanh`` of a symbol)."""
    if found is None:
        raise EffectError(f"{where} returns nothing")
    try:
        expression = ca.SX(found)
    except (NotImplementedError, TypeError):
        raise EffectError(f"{where} returns {type(found).__name__}; allowed: one expression") from None
    if not expression.is_scalar():
        raise EffectError(f"{where} returns {expression.shape[0]} x {expression.shape[1]} values; allowed: one")
    f = ca.Function("f", ca.symvar(expression), [expression])
    constants = (f.instruction_constant(k) for k in range(f.n_instructions()) if f.instruction_id(k) == ca.OP_CONST)
    if not all(math.isfinite(value) for value in constants):
        raise EffectError(f"{where} is no number: x and p are symbols, which math.tanh and float lose; {_INSTEAD}")


def _check_rates(effect: Effect, where: str, found: Any) -> None:
    if not isinstance(found, dict) or set(found) != set(effect.states):
        given = choices(map(str, found)) if isinstance(found, dict) else type(found).__name__
        raise EffectError(f"{where} returns {given}; allowed: a derivative for each of {choices(effect.states)}")
    for name, value in found.items():
        _check(f"{where} of {name}", value)


__all__ = ["asked"]
