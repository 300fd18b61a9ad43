"""A value and its standard error as text, with the digits that the error leaves."""

from __future__ import annotations

import math

MAX_DIGITS = 7
"""Digits of a value after its first: beyond, an error says more of the arithmetic than of the value."""
PLAIN_POWERS = range(-4, 6)
"""Powers of ten of the larger of the two that are written without an exponent."""


def with_error(value: float, std: float | None) -> tuple[str, str]:
    """Return a value and its standard error: two digits of the error, trailing zeros too, and the value to the same
    place. Without an error the value has five digits, and the other text is empty.
    """
    if std is None or not 0.0 < std < math.inf or not math.isfinite(value):
        return f"{value:.5g}", ""
    first, last = _power(max(abs(value), std)), _power(std, 1) - 1
    power, least = 0 if first in PLAIN_POWERS else first, max(last, first - MAX_DIGITS)
    shown, error = (_to_place(x, least, power) for x in (value, std))
    return shown, error if least == last else f"{std:.1e}"


def _power(x: float, digits: int = 6) -> int:
    """Return the power of ten of a number that is rounded to so many digits after its first."""
    return int(f"{x:.{digits}e}".partition("e")[2])


def _to_place(x: float, last: int, power: int) -> str:
    """Return a number rounded to a power of ten, ``last``, written as a multiple of another one."""
    rounded = round(x, -last) / 10.0**power + 0.0
    if power and rounded == 0.0:
        return "0"
    text = f"{rounded:.{max(power - last, 0)}f}"
    return f"{text}e{power:+03d}" if power else text


__all__ = ["with_error"]
