"""Units as columns state them: parsed to a scale and a dimension, and converted.

A unit is a product of known symbols with SI prefixes: ``mm/s``, ``N·m``, ``N*mm``, ``rad s^-1``, ``m/s²``.
The angle is kept as a dimension of its own, so that ``Hz`` is not taken for ``rad/s``. A translational model
unit accepts its rotary counterpart (m and rad, m/s and rad/s, N and N·m), because the mass-spring-damper
plants stand for both kinds of drive.
"""

from __future__ import annotations

import math
import re
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    Array = npt.NDArray[np.float64]

Dimension = tuple[int, int, int, int, int, int]
"""Exponents of metre, kilogram, second, ampere, kelvin, radian."""

_M: Dimension = (1, 0, 0, 0, 0, 0)
_KG: Dimension = (0, 1, 0, 0, 0, 0)
_S: Dimension = (0, 0, 1, 0, 0, 0)
_A: Dimension = (0, 0, 0, 1, 0, 0)
_K: Dimension = (0, 0, 0, 0, 1, 0)
_RAD: Dimension = (0, 0, 0, 0, 0, 1)
_ONE: Dimension = (0, 0, 0, 0, 0, 0)
_N: Dimension = (1, 1, -2, 0, 0, 0)
_NM: Dimension = (2, 1, -2, 0, 0, 0)
_W: Dimension = (2, 1, -3, 0, 0, 0)
_V: Dimension = (2, 1, -3, -1, 0, 0)

# Symbols that take a prefix, and symbols that take none.
_PREFIXED: dict[str, tuple[float, Dimension]] = {
    "m": (1.0, _M),
    "g": (1e-3, _KG),
    "s": (1.0, _S),
    "A": (1.0, _A),
    "K": (1.0, _K),
    "rad": (1.0, _RAD),
    "N": (1.0, _N),
    "Nm": (1.0, _NM),
    "J": (1.0, _NM),
    "W": (1.0, _W),
    "V": (1.0, _V),
    "Hz": (1.0, (0, 0, -1, 0, 0, 0)),
    "Ohm": (1.0, (2, 1, -3, -2, 0, 0)),
    "H": (1.0, (2, 1, -2, -2, 0, 0)),
    "Pa": (1.0, (-1, 1, -2, 0, 0, 0)),
    "Wb": (1.0, (2, 1, -2, -1, 0, 0)),
    "T": (1.0, (0, 1, -2, -1, 0, 0)),
}
_PLAIN: dict[str, tuple[float, Dimension]] = {
    "1": (1.0, _ONE),
    "-": (1.0, _ONE),
    "%": (0.01, _ONE),
    "sec": (1.0, _S),
    "second": (1.0, _S),
    "seconds": (1.0, _S),
    "min": (60.0, _S),
    "h": (3600.0, _S),
    "deg": (math.pi / 180, _RAD),
    "°": (math.pi / 180, _RAD),
    "rev": (2 * math.pi, _RAD),
    "turn": (2 * math.pi, _RAD),
    "rpm": (math.pi / 30, (0, 0, -1, 0, 0, 1)),
    "RPM": (math.pi / 30, (0, 0, -1, 0, 0, 1)),
    "kgf": (9.80665, _N),
    "bar": (1e5, (-1, 1, -2, 0, 0, 0)),
    "Ω": (1.0, (2, 1, -3, -2, 0, 0)),
}
_PREFIXES = {
    "n": 1e-9,
    "u": 1e-6,
    "µ": 1e-6,
    "μ": 1e-6,
    "m": 1e-3,
    "c": 1e-2,
    "d": 0.1,
    "k": 1e3,
    "M": 1e6,
    "G": 1e9,
}
_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_FACTOR = re.compile(r"(?P<symbol>[^\d^-]+|1|-)\^?(?P<power>-?\d+)?\Z")

_ROTARY: dict[Dimension, Dimension] = {
    _M: _RAD,
    (1, 0, -1, 0, 0, 0): (0, 0, -1, 0, 0, 1),
    (1, 0, -2, 0, 0, 0): (0, 0, -2, 0, 0, 1),
    _N: _NM,
}


@lru_cache(maxsize=256)
def parse(unit: str) -> tuple[float, Dimension] | None:
    """The scale to SI and the dimension of a unit; None where it is not known (``[0/1]``, ``[degC]``)."""
    text = unit.strip().translate(_SUPERSCRIPTS)
    if text in _PLAIN:
        return _PLAIN[text]
    scale, dimension, sign = 1.0, list(_ONE), 1
    for token in re.split(r"([/*·⋅×.\s]+)", text):
        separator = token.strip("*·⋅×. \t") if not re.search(r"[^/*·⋅×.\s]", token) else None
        if separator is not None:
            if separator not in ("", "/"):
                return None
            sign = -1 if separator == "/" else sign
            continue
        factor = _factor(token)
        if factor is None:
            return None
        scale *= factor[0] ** sign
        dimension = [a + sign * b for a, b in zip(dimension, factor[1], strict=True)]
    return (scale, _dimension(dimension)) if text else None


def _factor(token: str) -> tuple[float, Dimension] | None:
    """One symbol with an optional prefix and power: ``mm``, ``s2``, ``s^-1``."""
    match = _FACTOR.match(token)
    base = _symbol(match["symbol"]) if match else None
    if match is None or base is None:
        return None
    power = int(match["power"] or 1)
    return base[0] ** power, _dimension([power * b for b in base[1]])


def _symbol(symbol: str) -> tuple[float, Dimension] | None:
    for table in (_PLAIN, _PREFIXED):
        if symbol in table:
            return table[symbol]
    prefix, rest = _PREFIXES.get(symbol[:1]), symbol[1:]
    if prefix is None or rest not in _PREFIXED:
        return None
    scale, dimension = _PREFIXED[rest]
    return prefix * scale, dimension


def _dimension(exponents: list[int]) -> Dimension:
    m, kg, s, a, k, rad = exponents
    return (m, kg, s, a, k, rad)


def is_si(unit: str) -> bool:
    """True for no unit and for a coherent SI unit, whose values need no conversion."""
    parsed = [parse(choice) for choice in unit.split(" or ")]
    return not unit.strip() or all(one is not None and one[0] == 1.0 for one in parsed)


def conversion(found: str, wanted: str) -> tuple[float, str] | None:
    """How to bring a column from the unit `found` to the unit `wanted`.

    Returns
    -------
    (factor, unit)
        Multiply by the factor to get values in `unit`, which is `wanted` or, where the column is rotary and
        the model's unit translational, its rotary counterpart (``rad`` for ``m``). None where the two cannot
        be reconciled.
        `wanted` may offer a choice: ``"m or rad"``.
    """
    if not found.strip() or not wanted.strip() or found.strip() == wanted.strip():
        return 1.0, wanted
    choices = [parsed for choice in wanted.split(" or ") if (parsed := parse(choice)) is not None]
    have = parse(found)
    if have is None:
        return None
    for scale, dimension in choices:
        if dimension == have[1]:
            return _ratio(have[0], scale), wanted
    for scale, dimension in choices:
        if _ROTARY.get(dimension) == have[1]:
            return _ratio(have[0], scale), _ROTARY_NAMES[dimension]
    return None


_ROTARY_NAMES: dict[Dimension, str] = dict(zip(_ROTARY, ("rad", "rad/s", "rad/s^2", "N·m"), strict=True))


def rotary(unit: str) -> str:
    """The rotary counterpart of a unit (``N·m`` for ``N``), or the unit itself."""
    parsed = parse(unit.split(" or ", 1)[0])
    return _ROTARY_NAMES.get(parsed[1], unit) if parsed is not None and parsed[0] == 1.0 else unit


def kind(unit: str) -> str:
    """``"linear"`` for m, m/s, N, ``"rotary"`` for rad, rad/s, N·m, else ``""``."""
    parsed = parse(unit)
    if parsed is None:
        return ""
    if parsed[1] in _ROTARY:
        return "linear"
    return "rotary" if parsed[1] in _ROTARY.values() else ""


def _ratio(have: float, scale: float) -> float:
    return 1.0 if have == scale else have / scale


def scaled(values: Array, factor: float) -> Array:
    """`values * factor`; a factor such as 1e-3 divides by 1000 instead, which rounds once and correctly."""
    if factor == 1.0:
        return values
    inverse = round(1 / factor)
    if factor < 1 and math.isclose(inverse * factor, 1.0, rel_tol=1e-15):
        return values / float(inverse)
    return values * factor
