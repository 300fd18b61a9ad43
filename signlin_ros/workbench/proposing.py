"""Which column of a record seems to be which signal of a model: by name, by unit, and by what follows from what.

What the reader finds by itself stays as it is; a proposal is only made for the rest, and says what it rests on.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros import units
from signlin_ros.checks.factors import other_units
from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.records import Record

Array = NDArray[np.float64]

_VOLTAGE = (
    *("voltage", "volt", "volts", "u", "v_in", "vin", "vm", "v_motor", "u_motor", "duty", "pwm", "cmd"),
    *("spannung", "stellgroesse", "tension", "voltaje", "tensione", "tensao", "napiecie", "spanning"),
    *("напряжение", "电压", "電圧"),
)
_CURRENT = (
    *("current", "i", "iq", "i_q", "i_a", "ia", "amps", "amp", "curr", "strom", "motorstrom", "courant"),
    *("corriente", "corrente", "prad", "stroom", "ток", "电流", "電流"),
)
_FAST = (
    *("geschwindigkeit", "vitesse", "velocidad", "velocita", "velocidade", "predkosc", "snelheid"),
    *("скорость", "速度", "转速", "回転速度"),
)
_SPEED = ("speed", "velocity", "vel", "omega", "w", "rpm", "dq", "qd", "qdot", "rate", "gyro", "drehzahl")
_POSITION = (
    *("position", "pos", "angle", "theta", "q", "phi", "enc", "encoder", "counts", "winkel", "lage"),
    *("angulo", "angolo", "posicion", "posizione", "posicao", "polozenie", "kat", "hoek", "угол", "角度", "位置"),
)
_MOVED = (
    *("displacement", "position", "pos", "x", "q", "stroke", "travel", "angle", "disp", "weg", "hub", "winkel"),
    *("deplacement", "desplazamiento", "spostamento", "przemieszczenie", "posicion", "posizione", "位移", "変位"),
)
_FORCE = (
    *("force", "f", "torque", "tau", "load_cell", "effort", "thrust", "kraft", "moment", "drehmoment"),
    *("couple", "fuerza", "forza", "coppia", "sila", "kracht", "сила", "力", "扭矩"),
)
COLUMN_WORDS = {
    "voltage": _VOLTAGE,
    "current": _CURRENT,
    "speed": (*_SPEED, "winkelgeschwindigkeit", *_FAST),
    "velocity": ("velocity", "vel", "speed", "v", "dq", "qd", "qdot", "xdot", "dx", *_FAST),
    "position": _POSITION,
    "displacement": _MOVED,
    "force": _FORCE,
    "load_torque": ("load_torque", "t_l", "tl", "load", "last", "lastmoment"),
    "hysteresis": ("hysteresis",),
}
"""How people call what the models call by these names, in English and otherwise."""
WANTED = (
    "goal",
    "ref",
    "reference",
    "des",
    "desired",
    "target",
    "set",
    "setpoint",
    "cmd",
    "command",
    "soll",
    "sollwert",
    "action",
    "demand",
    "error",
    "err",
    "deviation",
)
"""In the name of a column that says what was asked for, or how far off that is, not what came of it."""
DIRECTION = frozenset(
    ("dir", "direction", "richtung", "drehrichtung", "sign", "sgn", "vorzeichen", "sens", "cw", "ccw")
)
"""In the name of a column that says which way it goes."""
DUTY, FULL = ("pwm", "duty", "tastgrad", "throttle"), (1.0, 100.0, 255.0, 1000.0, 1023.0, 4095.0, 32767.0, 65535.0)
"""In the name of a column in parts of the supply, and what the whole of it may be."""
ARDUINO = 255.0
"""The full scale of a PWM of eight bits."""
MIN_DERIVATIVE_CORRELATION = 0.9
"""Correlation of a derivative with a column from which on one is taken for the derivative of the other."""
STILL_PENALTY = 3.0
"""Points that a column loses which holds one value throughout: nothing moves in it."""
MIN_PROPOSAL_POINTS = 2.0
"""Points below which a likeness is not proposed: a name that is part of a column's, or a unit with half a name."""


BY_NAME = "found by its name"


def mapping(model: Model, records: Sequence[Record], given: Mapping[str, str]) -> list[dict[str, Any]]:
    """Return for every signal of a model the column it is read from, or proposed, or None; and why."""
    names = list(dict.fromkeys((*model.inputs, *model.states, *model.outputs)))
    rows = [_row(model, name, records, given) for name in names]
    taken = {row["column"] for row in rows if row["column"]}
    told = bool(model.signals)  # a model file that maps signals has said which ones it wants
    for row in rows:
        if row["why"] == BY_NAME and not row["needed"] and _still(records, row["column"]):
            _replace(row, records, taken)
        if row["column"] is None and row["signal"] not in given and (row["needed"] or not told):
            _propose(row, records, taken)
    if records and not told:
        _follow(rows, records[0], taken)
    for row in rows:
        if records and row["kind"] == "input" and row["column"]:
            row.update(_driven(row["column"], records))
    return rows


def _driven(label: str, records: Sequence[Record]) -> dict[str, Any]:
    """Return what a column that drives may need: ``direction``, a column of two values called so where it never changes
    its own sign; ``full``, what its full scale may be, the likeliest first, where it is a duty cycle or a PWM without
    a unit, or in %.
    """
    signal = next((s for k, s in records[0].signals.items() if (s.label or k) == label), None)
    if signal is None or not np.isfinite(signal.values).any():
        return {}
    low, high = float(np.nanmin(signal.values)), float(np.nanmax(np.abs(signal.values)))
    tokens = _tokens(label)
    found: dict[str, Any] = {}
    if any(word in tokens for word in DUTY) and signal.unit in ("", "%"):
        found["full"] = [full for full in FULL if high <= full]
        if signal.unit == "%":
            found["full"] = [100.0, *(full for full in found["full"] if full != 100.0)]
        elif "pwm" in tokens and 1.0 < high <= ARDUINO:
            found["full"] = [ARDUINO, *(full for full in found["full"] if full != ARDUINO)]
    others = (name for name, _ in _common(records) if name != label) if low >= 0.0 else ()
    ways = (name for name in others if not DIRECTION.isdisjoint(_tokens(name)))
    if way := next(ways, ""):
        found["direction"] = way
    return found


def _plain(label: str) -> str:
    """Return a column's name without unit, in small letters without accents."""
    letters = unicodedata.normalize("NFKD", re.sub(r"[\[(].*", "", label).strip().lower().replace("ł", "l"))
    return unicodedata.normalize("NFC", "".join(c for c in letters if not unicodedata.combining(c)))


def _tokens(label: str) -> list[str]:
    return [t for t in re.split(r"[\W\d_]+", _plain(label)) if t]


def _row(model: Model, name: str, records: Sequence[Record], given: Mapping[str, str]) -> dict[str, Any]:
    kind = "input" if name in model.inputs else "state" if name in model.states else "output"
    needed = name in model.inputs and name not in model.plant.optional_inputs
    unit = model.units[name]
    row = {"signal": name, "unit": unit, "units": _units(unit), "kind": kind, "needed": needed}
    row |= {"proposed": False, "set": name in given}
    if name in given:
        return {**row, "column": given[name] or None, "why": "as you set it"}
    if name in model.signals:
        return {**row, "column": model.signals[name], "why": "as the model file says"}
    aliases = [a for a in ("position", "velocity", "effort") if _is(model, a, name)]
    column = _found(records, [name, *aliases])
    return {**row, "column": column, "why": BY_NAME if column else "no column found"}


def _units(unit: str) -> list[str]:
    """Return the units in which a column for what a model has in ``unit`` may be."""
    return list(
        dict.fromkeys(other for one in unit.split(" or ") for other in (one, *other_units(one)) if other != "-")
    )


def _is(model: Model, alias: str, name: str) -> bool:
    try:
        return model.canonical(alias) == name
    except InputError:
        return False


def _found(records: Sequence[Record], names: Sequence[str]) -> str | None:
    for name in names:
        try:
            keys = [record.find(name) for record in records]
        except InputError:
            continue
        if keys and all(keys):
            return records[0].labels[str(keys[0])]
    return None


def _still(records: Sequence[Record], label: str | None) -> bool:
    """Tell whether a column holds one value throughout all records."""
    keys = [next((k for k, s in r.signals.items() if (s.label or k) == label), None) for r in records]
    values = [r.signals[key].values for r, key in zip(records, keys, strict=True) if key is not None]
    return bool(values) and all(
        float(np.nanmax(v, initial=-np.inf) - np.nanmin(v, initial=np.inf)) <= 0 for v in values
    )


def _replace(row: dict[str, Any], records: Sequence[Record], taken: set[str]) -> None:
    """Put another column into a row whose own holds one value throughout, if one is as likely."""
    own = row["column"]
    _propose(row, records, taken)
    if row["column"] != own:
        row["why"] += f"; {own} holds one value throughout"


def shows_angle(label: str, unit: str) -> bool:
    """Tell whether a column is called like an angle, and is in a unit of one."""
    row = {"signal": "position", "unit": "rad", "kind": "state"}
    return bool(unit) and _likeness(row, label, unit)[0] >= MIN_PROPOSAL_POINTS and bool(units.conversion(unit, "rad"))


def _propose(row: dict[str, Any], records: Sequence[Record], taken: set[str]) -> None:
    """Put the likeliest free column into a row."""
    common = [c for c in _common(records) if c[0] not in taken]
    scored = [(*_likeness(row, label, unit), label, unit) for label, unit in common]
    scored = [
        (p - STILL_PENALTY * (p >= MIN_PROPOSAL_POINTS and _still(records, label)), why, label, u)
        for p, why, label, u in scored
    ]
    best = max(scored, default=None, key=lambda s: s[0])
    if best is None or best[0] < MIN_PROPOSAL_POINTS:
        return
    _, why, label, unit = best
    row.update(column=label, why=_guess(row, why, unit), proposed=True)
    taken.add(label)


def _guess(row: Mapping[str, Any], why: str, unit: str) -> str:
    """Return the evidence of a proposed mapping, and its open questions."""
    return f"guessed: {why}" + ("" if unit else f"; in what unit? Taken in {row['unit']}")


def _common(records: Sequence[Record]) -> list[tuple[str, str]]:
    """Return label and unit of the columns that every record has."""
    if not records:
        return []
    shared = set.intersection(*(set(r.labels.values()) for r in records))
    return [(s.label or name, s.unit) for name, s in records[0].signals.items() if (s.label or name) in shared]


def _likeness(row: Mapping[str, Any], label: str, unit: str) -> tuple[float, str]:
    """Return points and the reason why a column may be a signal."""
    plain, tokens = _plain(label), _tokens(label)
    words = COLUMN_WORDS.get(row["signal"], (row["signal"],))
    points, why = 0.0, []
    if plain in words:
        points, why = points + 3.0 - words.index(plain) / 50, [f"called {plain!r}"]
    elif hit := next((w for w in words if w in tokens), None):
        points, why = points + (2.5 if len(hit) > 1 else 2.0) - words.index(hit) / 50, [f"{hit!r} in its name"]
    elif hit := next((w for w in words if len(w) > 2 and w in plain), None):
        points, why = points + 1.5, [f"{hit!r} in its name"]
    if row["kind"] != "input" and any(word in tokens for word in WANTED):
        points -= 4.0
    if unit == "%" and row["kind"] == "input":  # a part of the supply: its full scale is asked for
        why += ["a part of its full scale"]
    elif unit:
        fits = units.conversion(unit, row["unit"]) is not None
        points += 1.5 if fits else -4.0
        why += [f"in {unit}"] if fits else []
    return points, " and ".join(why)


def _follow(rows: list[dict[str, Any]], record: Record, taken: set[str]) -> None:
    """Find a velocity or position by the other one: the derivative of one is the other, whatever it is called."""
    pairs = (("position", "speed"), ("displacement", "velocity"))
    by_name = {row["signal"]: row for row in rows}
    for slow, fast in pairs:
        if slow not in by_name or fast not in by_name:
            continue
        a, b = by_name[slow], by_name[fast]
        if a["column"] and not b["column"]:
            _by_derivative(b, a, record, taken, lambda one, other: _correlation(record.t, one, other))
        elif b["column"] and not a["column"]:
            _by_derivative(a, b, record, taken, lambda one, other: _correlation(record.t, other, one))


def _by_derivative(row: dict[str, Any], known: dict[str, Any], record: Record, taken: set[str], alike: Any) -> None:
    try:
        key = record.find(known["column"])
    except InputError:
        return
    if key is None:
        return
    reference = record.signals[key].values
    free = {
        n: s for n, s in record.signals.items() if (s.label or n) not in taken and _may_be(row, s.label or n, s.unit)
    }
    scored = [(alike(reference, s.values), s.label or n, s.unit) for n, s in free.items()]
    (likeness, _), label, unit = max(scored, default=((0.0, 0.0), "", ""), key=lambda one: one[0])
    if likeness >= MIN_DERIVATIVE_CORRELATION:
        why = f"one is the derivative of the other (correlation {likeness:.2f})"
        row.update(column=label, why=_guess(row, why, unit), proposed=True)
        taken.add(label)


def _may_be(row: Mapping[str, Any], label: str, unit: str) -> bool:
    """Tell whether a column may be what is measured by its unit, where that is known, and by its name."""
    fits = units.parse(unit) is None or units.conversion(unit, row["unit"]) is not None
    return fits and not any(word in WANTED for word in _tokens(label))


def _correlation(t: Array, position: Array, velocity: Array) -> tuple[float, float]:
    """Return how well the slope of one column (T,) goes with another, 0 to 1 in hundredths, and of several that go as
    well the nearness of their sizes: minus the logarithm of their ratio, without its sign.
    """
    few = slice(0, min(t.size, 20_000))
    slope, v = np.gradient(np.nan_to_num(position[few]), t[few]), np.nan_to_num(velocity[few])
    if slope.std() == 0 or v.std() == 0:
        return 0.0, 0.0
    return round(abs(float(np.corrcoef(slope, v)[0, 1])), 2), -abs(float(np.log(slope.std() / v.std())))


__all__ = ["mapping"]
