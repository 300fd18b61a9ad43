"""Units as columns state them: read, checked for their dimension, and converted.

What is not SI is looked up with Pint [https://pint.readthedocs.io], which is loaded only then. A unit is a product of
symbols with powers: ``mm/s``, ``N·m``, ``oz-in``, ``rad s^-1``, ``deg per s``, ``m/s²``. The angle is kept as a
dimension of its own, so that ``Hz`` is not taken for ``rad/s``. What may mean several things (``lb``: a mass or a
force; ``ms``: milliseconds or m/s) means the one whose dimension fits. A translational model unit accepts its rotary
counterpart (m and rad, m/s and rad/s, N and N·m), because the mass-spring-damper plants stand for both kinds of drive.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    Array = npt.NDArray[np.float64]

Dimension = tuple[int, int, int, int, int, int]
"""Exponents of metre, kilogram, second, ampere, kelvin, radian."""
Reading = tuple[float, Dimension]
"""What a unit may mean: its size in SI units, and its dimension."""

_BASES = ("meter", "kilogram", "second", "ampere", "kelvin", "radian")
_ONE: Dimension = (0, 0, 0, 0, 0, 0)
_M: Dimension = (1, 0, 0, 0, 0, 0)
_RAD: Dimension = (0, 0, 0, 0, 0, 1)
_N: Dimension = (1, 1, -2, 0, 0, 0)
_NM: Dimension = (2, 1, -2, 0, 0, 0)
_G0 = 9.80665
"""A weight in N over its mass in kg: standard gravity, by which forces are stated in lb, oz, kg or g."""

_SI: dict[str, Dimension] = {
    "1": _ONE,
    "-": _ONE,
    "m": _M,
    "kg": (0, 1, 0, 0, 0, 0),
    "s": (0, 0, 1, 0, 0, 0),
    "A": (0, 0, 0, 1, 0, 0),
    "K": (0, 0, 0, 0, 1, 0),
    "rad": _RAD,
    "N": _N,
    "Nm": _NM,
    "J": _NM,
    "W": (2, 1, -3, 0, 0, 0),
    "V": (2, 1, -3, -1, 0, 0),
    "Hz": (0, 0, -1, 0, 0, 0),
    "Ohm": (2, 1, -3, -2, 0, 0),
    "H": (2, 1, -2, -2, 0, 0),
    "Pa": (-1, 1, -2, 0, 0, 0),
    "Wb": (2, 1, -2, -1, 0, 0),
    "T": (0, 1, -2, -1, 0, 0),
}
"""Coherent SI units, for which nothing is loaded."""

_OWN: dict[str, tuple[str, ...]] = {
    "c": (),
    "C": (),
    "F": (),
    "G": (),
    "a": (),
    "b": (),
    "d": (),
    "e": (),
    "u": (),
    "l": (),
    "amps": ("A",),
    "volt": ("V",),
    "ohms": ("Ohm",),
    "ω": (),
    "sec": ("s",),
    "secs": ("s",),
    "second": ("s",),
    "seconds": ("s",),
    "radian": ("rad",),
    "radians": ("rad",),
    "metre": ("m",),
    "meter": ("m",),
    "newton": ("N",),
    "ms": ("millisecond", "m/s"),
    "mms": ("mm/s",),
    "cms": ("cm/s",),
    "mps": ("m/s",),
    "mmps": ("mm/s",),
    "mps2": ("m/s2",),
    "kmh": ("km/hour",),
    "ips": ("inch/s",),
    "fps": ("ft/s",),
    "rads": ("rad/s", "rad"),
    "radps": ("rad/s",),
    "rad2": ("rad^2",),
    "mrad": ("milliradian",),
    "urad": ("microradian",),
    "deg": ("degree",),
    "degs": ("degree/s", "degree"),
    "degps": ("degree/s",),
    "dps": ("degree/s",),
    "mdps": ("0.001 degree/s",),
    "kdps": ("1000 degree/s",),
    "rev": ("turn",),
    "revs": ("turn", "turn/s"),
    "r": ("turn",),
    "U": ("turn",),
    "rot": ("turn",),
    "rotation": ("turn",),
    "rotations": ("turn",),
    "cyc": ("turn",),
    "rpm": ("turn/minute",),
    "rps": ("turn/s",),
    "krpm": ("1000 turn/minute",),
    "mil": ("0.001 inch",),
    "mils": ("0.001 inch",),
    "micron": ("micrometer",),
    "microns": ("micrometer",),
    "lbs": ("lb",),
    "#": (),
    "klb": ("1000 lb",),
    "kips": ("kip",),
    "ozf": ("ounce_force",),
    "kp": ("kgf",),
    "nm": ("nanometer", "Nm"),
    "Nm": ("Nm",),
    "Nmm": ("0.001 Nm",),
    "Ncm": ("0.01 Nm",),
    "mNm": ("0.001 Nm",),
    "uNm": ("1e-6 Nm",),
    "cNm": ("0.01 Nm",),
    "kNm": ("1000 Nm",),
    "ozin": ("oz*inch",),
    "inoz": ("oz*inch",),
    "lbin": ("lb*inch",),
    "inlb": ("lb*inch",),
    "lbfin": ("lbf*inch",),
    "lbft": ("lb*ft",),
    "ftlb": ("lb*ft",),
    "ftlbs": ("lb*ft",),
    "lbfft": ("lbf*ft",),
    "ftlbf": ("lbf*ft",),
    "kgcm": ("kg*cm",),
    "kgfcm": ("kgf*cm",),
    "kgm": ("kg*m",),
    "gcm": ("g*cm",),
    "gfcm": ("gf*cm",),
    "h": ("hour",),
    "min": ("minute",),
    "mins": ("minute",),
    "us": ("microsecond",),
    "usec": ("microsecond",),
    "msec": ("millisecond",),
    "nsec": ("nanosecond",),
    "nanosec": ("nanosecond",),
    "millis": ("millisecond",),
    "micros": ("microsecond",),
    "nanos": ("nanosecond",),
    "arms": ("A",),
    "apk": ("A",),
    "vrms": ("V",),
    "vdc": ("V",),
    "adc": ("A",),
    "ma": ("mA",),
    "mv": ("mV",),
    "ua": ("uA",),
    "ka": ("kA",),
    "kv": ("kV",),
    "pct": ("%",),
    "percent": ("%",),
    "°": ("degree",),
    "degree": ("degree",),
    "degrees": ("degree",),
    '"': ("inch",),
    "grad": ("degree",),
    "gradi": ("degree",),
    "grados": ("degree",),
    "graus": ("degree",),
    "degre": ("degree",),
    "degres": ("degree",),
    "degré": ("degree",),
    "degrés": ("degree",),
    "gr": ("degree", "gram"),
    "upm": ("turn/minute",),
    "1/min": ("turn/minute", "1/minute"),
    "/min": ("turn/minute",),
    "min-1": ("turn/minute", "1/minute"),
    "min^-1": ("turn/minute", "1/minute"),
    "u/min": ("turn/minute",),
    "u/s": ("turn/s",),
    "umin": ("turn/minute",),
    "umdr": ("turn",),
    "umdrehung": ("turn",),
    "umdrehungen": ("turn",),
    "tr": ("turn",),
    "trs": ("turn",),
    "tour": ("turn",),
    "tours": ("turn",),
    "giri": ("turn",),
    "obr": ("turn",),
    "ot": ("turn",),
    "omw": ("turn",),
    "varv": ("turn",),
    "об": ("turn",),
    "мин": ("minute",),
    "с": ("s",),
    "об/мин": ("turn/minute",),
    "sek": ("s",),
    "sekunde": ("s",),
    "sekunden": ("s",),
    "seconde": ("s",),
    "secondes": ("s",),
    "segundos": ("s",),
    "secondi": ("s",),
    "转": ("turn",),
    "圈": ("turn",),
    "回転": ("turn",),
    "회전": ("turn",),
    "分": ("minute",),
    "分钟": ("minute",),
    "분": ("minute",),
    "秒": ("s",),
    "초": ("s",),
    "毫秒": ("millisecond",),
    "ミリ秒": ("millisecond",),
    "밀리초": ("millisecond",),
    "微秒": ("microsecond",),
    "マイクロ秒": ("microsecond",),
    "度": ("degree",),
    "도": ("degree",),
    "弧度": ("rad",),
    "ラジアン": ("rad",),
    "伏": ("V",),
    "伏特": ("V",),
    "ボルト": ("V",),
    "安": ("A",),
    "安培": ("A",),
    "毫安": ("mA",),
    "アンペア": ("A",),
    "牛": ("N",),
    "牛顿": ("N",),
    "牛米": ("Nm",),
    "牛·米": ("Nm",),
    "米": ("m",),
    "毫米": ("mm",),
    "ミリ": ("mm",),
    "мс": ("millisecond",),
    "мкс": ("microsecond",),
    "сек": ("s",),
    "рад": ("rad",),
    "град": ("degree",),
    "гр": ("degree",),
    "мм": ("mm",),
    "м": ("m",),
    "в": ("V",),
    "мв": ("mV",),
    "а": ("A",),
    "ма": ("mA",),
    "н": ("N",),
    "нм": ("Nm",),
    "н·м": ("Nm",),
    "daNm": ("10 Nm",),
    "degc": ("K",),
    "deg c": ("K",),
    "deg_c": ("K",),
    "°c": ("K",),
    "° c": ("K",),
    "℃": ("K",),
    "celsius": ("K",),
    "degf": ("0.5555555555555556 K",),
    "°f": ("0.5555555555555556 K",),
    "℉": ("0.5555555555555556 K",),
    "fahrenheit": ("0.5555555555555556 K",),
    "dNm": ("0.1 Nm",),
}
"""What Pint does not know, reads as something else (``Nm``: per kilogram; ``amps``: a velocity), or what is written in
other letters; looked up as it is written, then in small letters. Nothing: no unit, whatever Pint would make of it.
"""

_ZEROS = {"degc": 273.15, "°c": 273.15, "℃": 273.15, "celsius": 273.15}
_ZEROS |= dict.fromkeys(("degf", "°f", "℉", "fahrenheit"), 273.15 - 32.0 / 1.8)
"""The temperature in K at which scales that do not begin at 0 K show 0; written without spaces, in small letters."""

_MEANT = ("", "kilo", "milli", "micro", "nano")
"""Prefixes that people write before any unit; before others a word is rather one that Pint takes apart: ``Grad``."""
_SELDOM = {
    "centi": ("meter", "newton"),
    "deci": ("meter",),
    "mega": ("newton", "pascal", "hertz", "watt", "ohm"),
    "giga": ("pascal", "hertz"),
    "hecto": ("pascal",),
    "deca": ("newton",),
    "deka": ("newton",),
}
"""Prefixes that they write before some units only."""

_ROTARY: dict[Dimension, Dimension] = {
    _M: _RAD,
    (1, 0, -1, 0, 0, 0): (0, 0, -1, 0, 0, 1),
    (1, 0, -2, 0, 0, 0): (0, 0, -2, 0, 0, 1),
    _N: _NM,
}
_ROTARY_NAMES: dict[Dimension, str] = dict(zip(_ROTARY, ("rad", "rad/s", "rad/s^2", "N·m"), strict=True))

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻μ", "0123456789-µ")
_FACTOR = re.compile(
    r"(?P<number>\d+(?:\.\d*)?(?:e-?\d+)?(?![\d.]))?(?P<symbol>[^\d^*/]*?)\^?\(?(?P<power>[-+]?\d+)?\)?\Z"
)
_MARKS = re.compile(r"\s*([/*·⋅×]|(?<!\d)\.|(?<=[A-Za-z])-(?=[A-Za-z])|\s)\s*")


@lru_cache(maxsize=512)
def readings(unit: str) -> tuple[Reading, ...]:
    """What a unit may mean, the likeliest first; nothing where it is not known: ``[0/1]``, ``[counts]``."""
    if re.fullmatch(r"[\d.]+", unit.strip()) and unit.strip() != "1":
        return ()
    text = unit.strip().translate(_SUPERSCRIPTS).replace("Ω", "Ohm").replace("Ω", "Ohm")
    text = re.sub(r"[\s_]+per[\s_]+", "/", text).replace("**", "^")
    whole = tuple(_symbol(text)) if text else ()
    if whole or "_" not in text:
        return whole or tuple(_products(text))
    return (*_products(text.replace("_", "/")), *_products(text.replace("_", "*")))


def parse(unit: str) -> Reading | None:
    """The size in SI units and the dimension of what a unit most likely means; None where it is not known."""
    return next(iter(readings(unit)), None)


def _products(text: str) -> Iterator[Reading]:
    """Read a product of symbols; what follows a ``/`` is divided by, brackets or not."""
    parts = _MARKS.split(re.sub(r"/\s*\(([^()]*)\)", r"/\1", text))
    factors: list[list[Reading]] = []
    sign = 1
    for i, part in enumerate(parts):
        if i % 2:
            sign = -1 if part == "/" else sign
            continue
        found = [(scale**sign, _times(dimension, sign)) for scale, dimension in _factor(part) if scale]
        if not found:
            return
        factors.append(found)
    for chosen in product(*factors):
        m, kg, s, a, k, rad = (sum(exponents) for exponents in zip(*(one[1] for one in chosen), strict=True))
        yield math.prod(one[0] for one in chosen), (m, kg, s, a, k, rad)


def _factor(token: str) -> list[Reading]:
    """One symbol with an optional number before it and power behind it: ``mm``, ``s2``, ``s^-1``, ``1000 ft``."""
    match = _FACTOR.match(token)
    if match is None or not token:
        return []
    number, power = float(match["number"] or 1), int(match["power"] or 1)
    symbol = match["symbol"] or ("1" if match["number"] else "")
    return [(number * scale**power, _times(dimension, power)) for scale, dimension in _symbol(symbol)]


def _symbol(symbol: str) -> Iterator[Reading]:
    """All that a single symbol may mean: as it is written, then in small letters."""
    if symbol in _SI:
        yield 1.0, _SI[symbol]
        return
    for key in dict.fromkeys((symbol, symbol.lower())):
        for text in _OWN.get(key, ()):
            yield from readings(text) if text.lower() != symbol.lower() else _known(text)
        if key not in _OWN:
            yield from _known(key)


def _known(symbol: str) -> tuple[Reading, ...]:
    found = (1.0, _SI[symbol]) if symbol in _SI else _pint(symbol)
    return () if found is None else (found,)


@lru_cache(maxsize=512)
def _pint(symbol: str) -> Reading | None:
    """What Pint knows of a symbol, if it is made of lengths, masses, times, currents, temperatures and angles."""
    if not re.fullmatch(r"[^\W\d]+|%", symbol):
        return None
    registry = _registry()
    try:
        symbol = "percent" if symbol == "%" else symbol
        if not any(_meant(prefix, name) for prefix, name, _ in registry.parse_unit_name(symbol)[:1]):
            return None
        scale, base = registry.get_base_units(registry.parse_units(symbol))
    except Exception:  # noqa: BLE001 - Pint raises nearly anything on what is no unit
        return None
    exponents = dict(base._units)
    if not exponents.keys() <= set(_BASES) or ("kelvin" in exponents and not symbol.endswith(("K", "kelvin"))):
        return None
    whole = tuple(round(float(exponents.get(name, 0))) for name in _BASES)
    return float(scale), whole  # type: ignore[return-value]


def _meant(prefix: str, name: str) -> bool:
    """Whether people write a unit with a prefix."""
    return prefix in _MEANT or name in _SELDOM.get(prefix, ())


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


def _times(dimension: Dimension, power: int) -> Dimension:
    m, kg, s, a, k, rad = (power * one for one in dimension)
    return (m, kg, s, a, k, rad)


def is_si(unit: str) -> bool:
    """True for no unit and for a coherent SI unit, whose values need no conversion."""
    parsed = [parse(choice) for choice in unit.split(" or ")]
    return not unit.strip() or all(one is not None and one[0] == 1.0 and not zero(unit) for one in parsed)


def is_temperature(unit: str) -> bool:
    """Whether a unit is one of temperature."""
    return any(dimension == (0, 0, 0, 0, 1, 0) for _, dimension in readings(unit))


def zero(unit: str) -> float:
    """What a unit's 0 is in SI units: 273.15 (K) of ``degC``, 0 of nearly every other."""
    return _ZEROS.get(re.sub(r"[\s_]", "", unit).lower(), 0.0)


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
    pairs = [(have, choice) for have in readings(found) for choice in choices]
    for have, (scale, dimension) in pairs:
        if have[1] == dimension:
            return _ratio(have[0], scale), wanted
    for have, (scale, dimension) in pairs:
        if _ROTARY.get(dimension) == have[1]:
            return _ratio(have[0], scale), _ROTARY_NAMES[dimension]
    for have, (scale, dimension) in pairs:
        force = _weight(have)
        if force[1] == dimension:
            return _ratio(force[0], scale), wanted
        if _ROTARY.get(dimension) == force[1]:
            return _ratio(force[0], scale), _ROTARY_NAMES[dimension]
    return None


def _weight(mass: Reading) -> Reading:
    """A mass (times a length) as the force (the torque) that it is the weight of."""
    m, kg, s, a, k, rad = mass[1]
    return mass[0] * _G0, (m + 1, kg, s - 2, a, k, rad)


def rotary(unit: str) -> str:
    """The rotary counterpart of a unit (``N·m`` for ``N``), or the unit itself."""
    parsed = parse(unit.split(" or ", 1)[0])
    return _ROTARY_NAMES.get(parsed[1], unit) if parsed is not None and parsed[0] == 1.0 else unit


def kind(unit: str) -> str:
    """``"linear"`` for m, m/s, N, ``"rotary"`` for rad, rad/s, N·m, else ``""``."""
    for _, dimension in readings(unit):
        for one in (dimension, _weight((1.0, dimension))[1]):
            if one in _ROTARY:
                return "linear"
            if one in _ROTARY.values():
                return "rotary"
    return ""


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
