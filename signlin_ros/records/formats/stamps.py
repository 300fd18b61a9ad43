"""Cells that hold no numbers but mean some: dates and times of day, and directions."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_DATE = r"(?:(?P<first>\d{1,4})(?P<mark>[-/.])(?P<second>\d{1,2})(?P=mark)(?P<third>\d{1,4})(?:[T /_-]|,\s)\s*)?"
_CLOCK = (
    r"(?P<hour>\d{1,3}):(?P<minute>\d\d?(?=:)|\d\d)"
    r"(?::(?P<second_of>\d\d?)(?:[.,;](?P<part>\d+))?|(?:[.,](?P<minutes_part>\d+)))?"
)
_ELAPSED = r"(?:(?P<days>\d+) days? )?"
_REST = r"\s*(?P<half>[AaPp][Mm])?\s*(?P<zone>Z|UTC|[-+]\d\d:?\d\d)?"
_STAMP = re.compile(rf"^\s*{_DATE}{_ELAPSED}{_CLOCK}{_REST}\s*$", re.MULTILINE)
_COMPACT = re.compile(r"^\s*(\d{4})(\d\d)(\d\d)[T_ -](\d\d)(\d\d)(\d\d)", re.MULTILINE)
"""Dates without marks, ``20231130_102345``."""
_YEAR = "jan feb mar apr may jun jul aug sep oct nov dec"
_MONTHS = {name: k + 1 for k, name in enumerate(_YEAR.split())} | {"mrz": 3, "mär": 3, "mai": 5, "okt": 10, "dez": 12}
_MONTH = rf"(?P<month>{'|'.join(_MONTHS)})[a-z]*\.?"
_NAMED = tuple(
    re.compile(rf"^\s*(?:[a-z]{{2,3}}[,.]? )?{form}", re.MULTILINE | re.IGNORECASE)
    for form in (
        rf"(?P<day>\d{{1,2}})[ .-]+{_MONTH}[ -](?P<year>\d{{4}})[ T](?P<clock>)",
        rf"{_MONTH}[ -](?P<day>\d{{1,2}}),?[ -](?P<year>\d{{4}})[ T](?P<clock>)",
        rf"{_MONTH} +(?P<day>\d{{1,2}}) (?P<clock>[\d:.]+) (?P<year>\d{{4}})$",
    )
)
"""Dates with the names of months: ``30-Nov-2023 10:23``, ``Nov 30 2023 10:23``, ``Thu Nov 30 10:23:45 2023``."""
_DAY = 86400.0

_FORWARD = "f fw fwd forward forwards + +1 ccw right up on true open out positive pos p high vor vorw"
_BACKWARD = "b bw bwd r rev reverse backward backwards back - -1 cw left l down dn negative neg n off false"
_NONE = "s stop stopped 0 none idle neutral brake coast halt hold"
_WORDS = {word: value for value, text in ((1.0, _FORWARD), (-1.0, _BACKWARD), (0.0, _NONE)) for word in text.split()}
"""What a direction may be called, in small letters. ``R`` is reverse beside ``F`` and right beside ``L``."""


@dataclass(frozen=True, eq=False)
class StampTimes:
    """``seconds`` (R,) since the first, ``what`` they were (``dates and times``), ``start``: the first as written."""

    seconds: Array
    what: str
    start: str


@dataclass(frozen=True, eq=False)
class Directions:
    """``values`` (R,) of 1, 0 and -1, and what was taken for which."""

    values: Array
    said: str


def times_of_day(cells: Sequence[str]) -> StampTimes | None:
    """Dates and times, or times of day, as seconds since the first; None where any cell is neither.

    ISO 8601 (with or without a zone), ``09.11.2025 09:27:03,010``, ``11/9/2025 9:27:03 PM``, ``27:03.5`` (minutes and
    seconds), ``09:27:03;010``, ``9:7:3`` (no zeros in front), ``0 days 00:00:01.5`` (elapsed). Where a time of day has
    no date, one that falls by half a day or more begins the next day.
    """
    text = "\n".join(cells)
    found = _STAMP.findall(text) or _STAMP.findall(_in_numbers(text))
    if len(found) != len(cells) or not found:
        return None
    columns = dict(zip(_STAMP.groupindex, zip(*found, strict=True), strict=True))
    clock = _seconds(columns)
    days = _days(columns)
    if days is None:
        jumps = np.cumsum(np.concatenate([[0.0], np.diff(clock) < -_DAY / 2]))
        return StampTimes(clock - clock[0] + _DAY * jumps, "times of day", cells[0])
    whole = (days - days[0]) * _DAY + _zone(columns["zone"])
    return StampTimes((whole - whole[0]) + (clock - clock[0]), "dates and times", cells[0])


def _in_numbers(text: str) -> str:
    """Return dates without marks, or with the names of months, as ``2023-11-30``."""
    text = _COMPACT.sub(r"\1-\2-\3 \4:\5:\6", text)
    for form in _NAMED:
        text = form.sub(lambda m: f"{m['year']}-{_MONTHS[m['month'].lower()]}-{m['day']} {m['clock']}", text)
    return text


def _seconds(columns: dict[str, tuple[str, ...]]) -> Array:
    """Seconds of the day (R,)."""
    hour, minute = (np.array(columns[name], dtype=np.float64) for name in ("hour", "minute"))
    second = np.array([text or "0" for text in columns["second_of"]], dtype=np.float64)
    part = np.array([f"0.{text or '0'}" for text in columns["part"]], dtype=np.float64)
    half = np.array([text.lower() for text in columns["half"]])
    hour = np.where(half == "pm", hour % 12 + 12, np.where(half == "am", hour % 12, hour))
    if any(columns["minutes_part"]) or not any(columns["second_of"]):  # 27:03.5 are minutes and seconds
        rest = np.array([f"0.{text or '0'}" for text in columns["minutes_part"]], dtype=np.float64)
        if any(columns["minutes_part"]):
            return hour * 60.0 + minute + rest
    elapsed = np.array([text or "0" for text in columns["days"]], dtype=np.float64)
    return elapsed * _DAY + hour * 3600.0 + minute * 60.0 + second + part


def _days(columns: dict[str, tuple[str, ...]]) -> Array | None:
    """Days since some day (R,), None where there is no date in all cells."""
    if not all(columns["first"]):
        return None
    first, second, third = (np.array(columns[name], dtype=np.int64) for name in ("first", "second", "third"))
    if first.max() > 31:
        year, month, day = first, second, third
    elif columns["mark"][0] == "/" and first.max() <= 12:
        year, month, day = third, first, second
    else:
        year, month, day = third, second, first
    if month.max() > 12:
        month, day = day, month
    if month.min() < 1 or month.max() > 12 or day.min() < 1 or day.max() > 31:
        return None
    year = np.where(year < 100, year + 2000, year)
    months = (year - 1970) * 12 + month - 1
    return np.asarray(months.astype("datetime64[M]").astype("datetime64[D]").astype(np.int64) + day, dtype=np.float64)


def _zone(zones: tuple[str, ...]) -> Array:
    """What is to be added to the time in s (R,) because of its zone."""
    known = {zone: _offset(zone) for zone in set(zones)}
    return np.array([known[zone] for zone in zones])


def _offset(zone: str) -> float:
    if zone in ("", "Z", "UTC"):
        return 0.0
    sign = 1.0 if zone[0] == "-" else -1.0
    return sign * (3600.0 * float(zone[1:3]) + 60.0 * float(zone[-2:]))


def directions(cells: Sequence[str]) -> Directions | None:
    """1, 0 and -1 for cells that name directions, NaN where they are empty; None where any names none."""
    different = {cell.lower() for cell in set(cells)} - {""}
    right = bool(different & {"l", "left"}) and "r" in different
    table: dict[str, float] = {"": np.nan}
    for word in different:
        value = _direction(word, right)
        if value is None:
            return None
        table[word] = value
    if len({value for word, value in table.items() if word}) < 2:
        return None
    names = {value: sorted({c for c in cells if c and table[c.lower()] == value}) for value in (1.0, -1.0, 0.0)}
    said = ", ".join(f"{'/'.join(found)} is {value:g}" for value, found in names.items() if found)
    return Directions(np.array([table[cell.lower()] for cell in cells]), said)


def _direction(word: str, right: bool) -> float | None:
    if right and word == "r":
        return 1.0
    return _WORDS.get(word)
