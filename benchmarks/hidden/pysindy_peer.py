"""What sparse regression names on the same records: PySINDy with a library of common force laws, told no true value.

    pip install pysindy
    python -m benchmarks.hidden.pysindy_peer --groups single none --count 48

The measurements are smoothed and differentiated (Savitzky and Golay, several widths), the velocity's equation is fitted
by PySINDy's STLSQ on columns of equal size, and width and threshold are chosen by the derivative's error on the
validation record: the sparsest model within 2 % of the smallest error. The library holds the plant's own terms and each
catalogue force that is a function of what is measured, its shape parameters on a grid over the record's range. The
largest surviving term beyond the base gives the name; none, "adequate". Laws with states of their own, and delays, are
no columns of a library, and a record without all its channels cannot be differentiated: "not possible".
[Brunton, Proctor and Kutz 2016, doi:10.1073/pnas.1517384113]
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.hidden.drives import CHANNELS, MOTOR
from benchmarks.hidden.generator import DEVELOPMENT, GROUPS, HiddenRecord, draw
from benchmarks.hidden.score import wilson

Array = NDArray[np.float64]
Law = Callable[[Array, Array, Array], Array]
Term = tuple[str, Law]

WIDTHS = (9, 25, 61)
THRESHOLDS = np.geomspace(0.005, 0.7, 12)
CLOSE = 1.02
"""Validation errors within this factor are equal, and the sparser model is taken."""


def shapes(v: Array, q: Array, motor: bool) -> list[Term]:
    """Return the catalogue's forces, their shape parameters on a grid over the range of v and q."""
    found: list[Term] = [
        ("coulomb_friction", lambda f, v, q: np.sign(v)),
        ("quadratic_drag", lambda f, v, q: np.abs(v) * v),
        ("asymmetric_viscous_friction", lambda f, v, q: np.maximum(v, 0)),
        ("constant_load", lambda f, v, q: np.ones_like(v)),
        ("gravity_load", lambda f, v, q: np.sin(q)),
        ("cubic_stiffness", lambda f, v, q: q**3),
        ("load_dependent_friction", lambda f, v, q: np.abs(f) * np.sign(v)),
    ]
    if motor:
        found.append(("torque_constant_saturation", lambda f, v, q: f**3))
    found += [("stribeck_friction", _stribeck(share * float(v.std()))) for share in (0.05, 0.2)]
    found += [("hard_stop", _stop(share * float(np.abs(q).max()))) for share in (0.4, 0.6, 0.8)]
    orders = range(2, 15) if motor else np.array([2.0, 4.0, 8.0]) / float(q.std())
    found += [("cogging_torque", _wave(wave, float(N))) for N in orders for wave in (np.sin, np.cos)]
    return found


def _stribeck(v_s: float) -> Law:
    return lambda f, v, q: np.exp(-((v / v_s) ** 2)) * np.sign(v)


def _stop(gap: float) -> Law:
    return lambda f, v, q: q - np.clip(q, -gap, gap)


def _wave(wave: Callable[[Array], Array], N: float) -> Law:
    return lambda f, v, q: wave(N * q)


def library(record: HiddenRecord) -> list[Term]:
    """Return the terms of the velocity's equation; those that the base has carry no name."""
    settings = record.model["/**"]["ros__parameters"]
    motor, base = settings["plant"] == MOTOR, settings["parameters"]
    _, v, q = _coordinates(record.estimation, motor)
    own: list[Term] = [
        ("", lambda f, v, q: f),
        ("" if base["B" if motor else "c"] > 0 else "viscous_friction", lambda f, v, q: v),
        ("" if base.get("k", 0.0) > 0 else "linear_stiffness", lambda f, v, q: q),
    ]
    return own + shapes(v, q, motor)


def _coordinates(data: dict[str, Array], motor: bool) -> tuple[Array, Array, Array]:
    """Return what drives, the velocity and the position."""
    names = ("current", "speed", "position") if motor else ("force", "velocity", "displacement")
    return data[names[0]], data[names[1]], data[names[2]]


def _columns(data: dict[str, Array], motor: bool, terms: list[Term], method: Any) -> tuple[Array, Array]:
    """Return the terms (T, n) at the smoothed coordinates, and the velocity's derivative (T,)."""
    drive, v, q = _coordinates(data, motor)
    measured = [drive, v, q] if motor else [v, q]
    smooth = [np.asarray(method.smoother(a, **method.smoother_kws)) for a in measured]
    at = smooth if motor else [drive, *smooth]  # a commanded force is known
    slope = np.asarray(method(v[:, None], float(data["t"][1])))[:, 0]
    return np.column_stack([law(*at) for _, law in terms]), slope


def name_record(record: HiddenRecord) -> str:
    """Return the effect that the sparse regression names, "adequate" or "not possible"."""
    import pysindy as ps  # type: ignore[import-untyped, unused-ignore]

    plant = record.model["/**"]["ros__parameters"]["plant"]
    if any(n not in record.estimation for n in CHANNELS[plant]):
        return "not possible"
    terms, motor = library(record), plant == MOTOR
    tried: list[tuple[float, int, Array]] = []
    for width in WIDTHS:
        method = ps.SmoothedFiniteDifference(smoother_kws={"window_length": width, "polyorder": 3})
        X, slope = _columns(record.estimation, motor, terms, method)
        Y, unseen = _columns(record.validation, motor, terms, method)
        size = np.sqrt(np.mean(X**2, axis=0))
        for threshold in THRESHOLDS:  # of the columns' sizes, in standard deviations of the derivative
            sparse = ps.STLSQ(threshold=threshold, alpha=1e-6).fit(X / size, slope[:, None] / slope.std())
            row = np.asarray(sparse.coef_).ravel()
            wrong = (Y / size) @ row - unseen / slope.std()
            tried.append((float(wrong.std() / (unseen.std() / slope.std())), int(np.count_nonzero(row)), row))
    return _pick(tried, [name for name, _ in terms])


def _pick(tried: list[tuple[float, int, Array]], terms: list[str]) -> str:
    """Return the name of the largest surviving term beyond the base."""
    least = min(error for error, *_ in tried)
    row = min((t for t in tried if t[0] <= CLOSE * least), key=lambda t: (t[1], t[0]))[2]
    strength = np.abs(row) * [float(bool(name)) for name in terms]
    return terms[int(np.argmax(strength))] if strength.max() > 0 else "adequate"


def main() -> None:
    """Print the rates by group."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--groups", nargs="+", choices=GROUPS, default=["single", "none"])
    parser.add_argument("--count", type=int, default=48)
    parser.add_argument("--seed", type=int, default=DEVELOPMENT)
    parser.add_argument("--results", type=Path, help="write every answer as JSON")
    a = parser.parse_args()
    try:
        import pysindy  # noqa: F401
    except ImportError:
        sys.exit("PySINDy is not installed: pip install pysindy")
    answers: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for group in a.groups:
        for k in range(a.count):
            record = draw(group, k, a.seed)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                name = name_record(record)
            hidden = record.truth["hidden"]
            right = name == ("adequate" if hidden == ["none"] else hidden[0])
            answers[group].append({"name": record.name, "hidden": hidden, "answer": name, "right": right})
            print(f"{record.name} {'+'.join(hidden)} called {name}", file=sys.stderr)
    for group, rows in answers.items():
        hits = sum(r["right"] for r in rows)
        possible = sum(r["answer"] != "not possible" for r in rows)
        low, high = wilson(hits, len(rows))
        print(f"{group:14}{hits:4} / {len(rows)} {100 * low:.1f} .. {100 * high:.1f} %; possible {possible}")
    if a.results:
        a.results.write_text(json.dumps(answers, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
