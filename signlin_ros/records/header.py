"""What a column's head says: a name, a unit, a note. ``force [N] (=gtau*u)`` is ``force``, ``N``,
``(=gtau*u)``; ``speed_rpm`` is ``speed``, ``rpm``; ``Speed, rpm`` and ``speed/rpm`` too.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from signlin_ros import units
from signlin_ros.names import TIME_NAMES

_BRACKETS = re.compile(r"(?P<gap> ?)(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*(?:\([^()]*\)[^()]*)?)\))")
_AFTER = re.compile(r"(?P<name>[^/,]*[^/, ]) ?(?:, ?|/ ?(?=\(?[^/]+(?:/[^/]+)?\)?\Z))\(?(?P<unit>[^,()]+)\)?\Z")
_COUNTED = re.compile(
    r"(?:counts?|cnts?|ticks?|pulses?|increments?|incr?|lsb|quad(?:rature)? counts?)(?: ?/ ?[^/]+)?", re.IGNORECASE
)
"""Units that are no unit of anything: of an encoder or a converter, and what is counted in a time."""
_QUOTIENT = re.compile(r"(?P<name>.*[^_])_(?P<unit>[^_/, ]+/[^_/, ]+)\Z")
_IN = re.compile(r"(?P<name>.*?)(?:^|\s)in (?P<unit>\S+)\Z")
_FURTHER = "elapsed elapsed_time time_stamp datetime date_time date/time clock uptime ros_time tout rel_time stime utc"
_FURTHER += " x_value sec secs seconds millis micros zeit date ms_today datenum"
_FURTHER += " temps tiempo tempo tijd tid czas cas čas aika uhrzeit heure hora ora klokkeslett"
_FURTHER += " idő zaman время час 时间 時間 時刻 时刻 시간"
_TIMES = (*TIME_NAMES, *_FURTHER.split())
_TIME = re.compile(rf"(?:__?|%)?(?P<name>{'|'.join(_TIMES)})(?:\(\))?(?:_(?P<unit>s|sec|ms|us|ns))?\Z", re.IGNORECASE)
_TIME_UNITS = {"ms_today": "ms", "millis": "ms", "micros": "us", "sec": "s", "secs": "s", "seconds": "s"}
_ENDS_AS_TIME = re.compile(r"(?i).*(?:time|timestamp|stamp|clock)\Z")
_BEGINS_AS_TIME = re.compile(r"(?i)(?:(?:time|stamp)(?:stamp)?(?:[\W_].*|(?P<unit>[mun]s)(?:ec)?)?|epoch|ts)\Z")
"""Names of columns that are times where they go on from row to row: ``pi_time``, ``TimeUS``, ``time_since_boot``."""
_WIDE = {0xFF01 + k: 0x21 + k for k in range(94)} | {0x3000: " ", 0x3010: "[", 0x3011: "]"}
"""Signs of the width of Chinese ones, as brackets around a unit are often written: those of ASCII."""
_PAIR = re.compile(
    r"(?P<stem>.*?)(?P<unit>nano(?:sec|secs|seconds)|nsecs?|ns|micro(?:sec|secs|seconds)|usecs?|us)\Z", re.I
)

_SAFE = "rpm|krpm|rps|dps|degps|degs|rads|radps|rad|mrad|deg|rev|revs|turns|ms|us|ns|sec|min|mv|ma|ua|kv|volts?|amps?"
_SAFE += (
    "|nm|mnm|nmm|ncm|kn|mn|lbf|lb|kip|ozin|inlb|lbin|ftlb|kgcm|mm|cm|um|km|inch|mmps|mps|mms|cms|kmh|mph|ips|hz|pct"
)
_SAFE += "|(?:k?rad|mrad|deg|rev|turns?|m|mm|cm|um|in|ft|km)_(?:per_)?(?:s2?|sec|min|h)|rad_per_sec|n_m|vrms|arms"
_SAFE += "|(?:tr|tours?|rot|giri|obr|umdr|(?-i:U))_(?:per_)?(?:s|min)"
_SAFE += "|upm|grad|newtons?|meters?|metres?|degrees|radians|milliamps|millivolts|celsius|deg[cf]|percent|kg|g"
_SUFFIX = re.compile(rf"(?P<name>.*?[^_])_(?:in_)?(?P<unit>{_SAFE}|[vanmsVANms])\Z", re.IGNORECASE)
_CAMEL = {
    "Rpm": "rpm",
    "RPM": "rpm",
    "Rps": "rps",
    "Rad": "rad",
    "Rads": "rad",
    "Deg": "deg",
    "Degrees": "deg",
    "Radians": "rad",
    "Rotations": "turns",
    "Turns": "turns",
    "Volts": "V",
    "Millivolts": "mV",
    "Mv": "mV",
    "Amps": "A",
    "Milliamps": "mA",
    "Ma": "mA",
    "Nm": "N·m",
    "NewtonMeters": "N·m",
    "Newtons": "N",
    "Meters": "m",
    "Millimeters": "mm",
    "Mm": "mm",
    "Ms": "ms",
    "Us": "us",
    "Sec": "s",
    "Secs": "s",
    "Seconds": "s",
    "Celsius": "degC",
    "Hz": "Hz",
    "Percent": "%",
}
_IN_CAMEL = re.compile(rf"(?P<name>.*?[a-z\d])(?P<unit>{'|'.join(_CAMEL)})(?P<per>PerSec(?:ond)?|PerMin(?:ute)?)?\Z")
"""Units at the end of a name in camel case, ``velocityRadPerSec``."""
_WHOLE = re.compile(
    r"(?i:k?rpm|rev/min|rps|dps|deg(?:rees?)?(?:/s)?|rad/s|radps|mrad|turns/s|[mc]m/s|km/h|kmh)|[mc]m|m[AV]|kN|kgf|lbf"
)
"""Names of columns that are a unit and nothing else, as ``rpm``; no single letters, nor words as ``in``, ``min``."""

TIME_KEYS = frozenset(TIME_NAMES)
"""Keys that `signals` may map to a file's time column; they are no signals of a model."""


MOST_KEPT = 1 << 16
"""Header cells whose parts are kept: they are asked for once for every name that is looked for."""


@dataclass(frozen=True)
class Heading:
    """A column's head taken apart: `label` is the whole text, `name` what is left without unit and note.

    `suffix`: the unit is the end of the name (``speed_rpm``), so that it may be none (``q_m``); `number`: the column's
    place in the file, from 1, 0 where it has none.
    """

    label: str
    name: str
    unit: str = ""
    suffix: bool = False
    number: int = 0

    @property
    def time(self) -> tuple[int, str] | None:
        """For a time column its rank among the known names and its unit (may be empty), else None."""
        match = _TIME.match(self.name)
        if match is None:
            return None
        name = match["name"].lower()
        return _TIMES.index(name), self.unit or match["unit"] or _TIME_UNITS.get(name, "")

    @functools.cached_property
    def _squeezed(self) -> tuple[str, str, str]:
        """Text, name, and name with unit, each without white space."""
        return _squeezed(self.label), _squeezed(self.name), _squeezed(f"{self.name}[{self.unit}]")

    @functools.cached_property
    def _small(self) -> tuple[str, str]:
        """Text and name, without white space, in small letters."""
        return self._squeezed[0].lower(), self._squeezed[1].lower()

    def whole(self, spec: str) -> bool:
        """Whether `spec` is the whole text; white space does not count."""
        return _squeezed(spec) == self._squeezed[0]

    def bare(self, spec: str) -> bool:
        """Whether `spec` is the text without its note, or without note and unit."""
        return _squeezed(spec) in self._squeezed[1:]

    def loose(self, spec: str) -> bool:
        """Whether `spec` is the text or the name if large letters count as small ones, or its number: ``#6``, ``6``."""
        small = _squeezed(spec).lower()
        if self.number and small in (f"#{self.number}", f"{self.number}"):
            return True
        return small in self._small

    def matches(self, spec: str) -> bool:
        """Whether the user may call this column `spec`."""
        return self.whole(spec) or self.bare(spec) or self.loose(spec)


def tidy(text: str) -> str:
    """The text stripped, every run of white space as one blank, the wide signs of East Asia as those of ASCII."""
    return " ".join((text if text.isascii() else text.translate(_WIDE)).split())


def clock(headings: Sequence[Heading]) -> Heading | None:
    """The time column among the headings: the first of ``t``, ``time``, ``timestamp``, ``stamp``, ...; last ``T``,
    which may be a torque.
    """
    times = [head for head in headings if head.time is not None]
    return min(times, key=lambda head: (head.name == "T", (head.time or (99, ""))[0]), default=None)


def names_a_time(name: str) -> bool:
    """Whether a column may be a time by its name, ``pi_time``, ``TimeUS``, ``epoch``, if it goes on from row to row."""
    return bool(_ENDS_AS_TIME.match(name) or _BEGINS_AS_TIME.match(name))


def unit_of_time(name: str) -> str:
    """The unit at the end of such a name, ``us`` of ``TimeUS``, or nothing."""
    match = _BEGINS_AS_TIME.match(name)
    return (match["unit"] or "").lower() if match else ""


def pair(headings: Sequence[Heading]) -> tuple[Heading, Heading, float] | None:
    """Columns of whole seconds and of what is beyond them, and how many s one of the latter is."""
    names = {head.name.lower().strip(): head for head in headings}
    for name, head in names.items():
        match = _PAIR.match(name)
        if match is None:
            continue
        for whole in ("sec", "secs", "seconds", "s"):
            found = names.get(match["stem"] + whole)
            if found is not None and found is not head:
                return found, head, 1e-9 if match["unit"][0] == "n" else 1e-6
    return None


@functools.lru_cache
def _squeezed(text: str) -> str:
    return "".join(tidy(text).split())


@functools.lru_cache(maxsize=MOST_KEPT)
def heading(text: str, number: int = 0) -> Heading:
    """Take a header cell apart.

    Square brackets hold a unit where white space precedes them or the unit is known: ``q [0/1]`` and
    ``q[rad]`` have one,
    ``data[0]`` and ``velocity[wheel]`` have none. Round brackets hold a unit only where it is known:
    ``voltage (V)``; so does what stands behind a comma or a ``/``, and the end of the name, or all of it:
    ``speed_rpm``, ``rpm``.
    """
    return replace(_taken_apart(tidy(text)), number=number)


@functools.lru_cache(maxsize=MOST_KEPT)
def _taken_apart(label: str) -> Heading:
    topic = label.startswith("/")
    doubtful = None
    for match in _BRACKETS.finditer(label):
        square, unit = match["square"] is not None, (match["square"] or match["round"] or "").strip()
        spaced = square and bool(match["gap"]) and not unit.isdigit()
        if not match.start() or (topic and not match["gap"]):
            continue
        taken = Heading(label, label[: match.start()].rstrip(" /"), unit)
        if _known(unit) or (square and not unit):
            return taken
        if doubtful is None and (spaced or _COUNTED.fullmatch(unit)):  # another bracket may hold the unit
            doubtful = taken
    if doubtful is not None:
        return doubtful
    quotient = None if topic else _QUOTIENT.match(label)
    if quotient is not None and _known(quotient["unit"]):
        return Heading(label, quotient["name"], quotient["unit"])
    after = None if topic or _IN.match(label) else _AFTER.match(label)
    if after is not None and after["name"].count("(") == after["name"].count(")") and _known(after["unit"].strip()):
        return Heading(label, after["name"], after["unit"].strip())
    inside = None if topic else _IN.match(label)
    if inside is not None and _known(inside["unit"]):
        return Heading(label, inside["name"].strip() or label, inside["unit"])
    name = re.sub(r"\s+\(.*\Z", "", label) or label
    suffix = None if topic else _SUFFIX.match(name)
    if suffix is not None and not _TIME.match(name):
        return Heading(label, suffix["name"], suffix["unit"], suffix=True)
    camel = _IN_CAMEL.match(name)
    if camel is not None and not _TIME.match(name):
        per = {"S": "/s", "M": "/min"}[camel["per"][3]] if camel["per"] else ""
        return Heading(label, camel["name"], _CAMEL[camel["unit"]] + per, suffix=True)
    return Heading(label, name, name if _WHOLE.fullmatch(name) else "")


def _known(unit: str) -> bool:
    return unit not in ("", "1") and units.parse(unit) is not None
