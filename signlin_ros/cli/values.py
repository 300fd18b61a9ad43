"""Names and numbers from the texts of options."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import click

from signlin_ros.errors import InputError, suggest


def pairs_of(texts: Sequence[str], option: str, form: str) -> dict[str, str]:
    """Return ``name -> text`` from ``NAME=TEXT`` strings, each name once; raise `InputError` otherwise."""
    found: dict[str, str] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            raise InputError(f"{option}: found {text!r}; allowed: {form}")
        if name in found:
            raise InputError(f"{option}: {name} is given twice ({found[name]} and {value})")
        found[name] = value
    return found


def numbers_of(texts: Sequence[str], option: str) -> dict[str, float]:
    """Return ``name -> number`` from strings like ``current=0.4,speed=20``; raise `InputError` otherwise."""
    parts = [part for text in texts for part in text.split(",") if part.strip()]
    return {
        name: _number(value, f"{option}: {name}")
        for name, value in pairs_of(parts, option, "NAME=NUMBER, several separated by commas").items()
    }


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{where}: found {text!r}; allowed: a number, such as 0.4 or 1e-3") from None
    if not math.isfinite(value):
        raise InputError(f"{where}: found {text!r}; allowed: a finite number")
    return value


def by_own_name(model: Any, values: Mapping[str, float], option: str, names: Sequence[str]) -> dict[str, float]:
    """Return values by the model's own names; raise `InputError` on a bad or repeated one."""
    own: dict[str, float] = {}
    for name, value in values.items():
        try:
            plain = model.canonical(name)
        except InputError:
            plain = ""
        if plain not in names:
            raise InputError(_unknown(model, name, plain, option, names))
        if plain in own:
            raise InputError(f"{option}: {plain} is given twice, once as {name}")
        own[plain] = value
    return own


def _unknown(model: Any, name: str, plain: str, option: str, names: Sequence[str]) -> str:
    what = "state" if option == "--at" else "input"
    if plain:
        other = f"; {plain} is no {what} of this model" + ("; use --input" if plain in model.inputs else "")
    elif name == "position" and model.plant.position_optional:
        other = "; with_position: true in the model file makes the position a state"
    else:
        other = suggest(name, (*names, "position", "velocity"))
    return f"{option}: unknown {what} {name!r}; there are: {', '.join(names)}{other}"


def positive(ctx: click.Context, parameter: click.Parameter, value: float) -> float:
    """Refuse an option that is not between 0 and 1."""
    if not 0.0 < value < 1.0:
        raise click.BadParameter(f"{value!r} is not a number between 0 and 1")
    return value


__all__ = ["by_own_name", "numbers_of", "pairs_of", "positive"]
