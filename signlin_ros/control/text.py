"""`signlin gains` as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from signlin_ros.console import per_second, table

MEANING = {
    "kS": "dry friction while moving",
    "kV": "per speed",
    "kA": "per acceleration",
    "kP": "per position",
    "kG": "constant",
    "left": "RMS of what constants cannot show",
}


def gains_text(c: Mapping[str, Any]) -> str:
    """Return gains as text: constants, gains of both loops, A_k at speeds, and what each effect is worth."""
    w = c["weights"]
    head = (
        f"{c['model']}: {c['input']['name']} [{c['input']['unit']}] every {c['period']:g} s,"
        f" delay up to {c['delay']:g} s, speeds up to {c['speed']:.3g} {c['units']['speed']}\n"
        f"bandwidth {w['bandwidth']:.3g} rad/s, damping {w['damping']:g}, integral {w['integral']:g}"
    )
    return "\n\n".join([head, _constants(c), _loops(c), _points(c), _predicted(c)])


def units_of(c: Mapping[str, Any]) -> dict[str, str]:
    """Return the unit of every constant."""
    u, v, q = c["input"]["unit"], c["units"]["speed"], c["units"]["position"]
    return {"kS": u, "kV": f"{u}/({v})", "kA": f"{u}/({per_second(v)})", "kP": f"{u}/{q}", "kG": u, "left": u}


def _constants(c: Mapping[str, Any]) -> str:
    units = units_of(c)
    rows = [["", "whole model", "friction-free", "", ""]]
    for name, meaning in MEANING.items():
        values = (f"{c[kind][name]:.5g}" if abs(c[kind][name]) > 1e-9 else "0" for kind in _CONSTANT_ROWS)
        rows.append([name, *values, units[name], meaning])
    return "feed-forward  u = kS sign(v) + kV v + kA a + kP q + kG\n" + table(rows, right=[1, 2])


_CONSTANT_ROWS = ("feed_forward", "friction_free")


def _row(name: str, values: Mapping[str, Any]) -> list[str]:
    numbers = (
        (k, ", ".join(f"{one:.4g}" for one in v) if isinstance(v, list) else f"{v:.5g}") for k, v in values.items()
    )
    return [name, "  ".join(f"{key} {text}" for key, text in numbers if text)]


def _loops(c: Mapping[str, Any]) -> str:
    rows = [
        _row("speed, LQR with integral", c["speed_loop"]["lqr"]),
        _row("speed, PI", c["speed_loop"]["pi"]),
        _row("position, LQR with integral", c["position_loop"]["lqr"]),
        _row("position, PID", c["position_loop"]["pid"]),
    ]
    return "gains on the errors, each with a bandwidth [rad/s] that it holds at any delay\n" + table(rows)


def _points(c: Mapping[str, Any]) -> str:
    rows: list[Sequence[str]] = [["state", "kV", "kA", "kP", f"gains of the {c['operating_points'][0]['loop']} loop"]]
    for point in c["operating_points"]:
        state = ", ".join(f"{name} {value:.4g}" for name, value in point["state"].items() if value) or "0"
        gains = _row("", point["lqr"])[1] + ("" if point["above_floor"] else "  (below the floor: do not use)")
        rows.append([state, *(f"{point[name]:.5g}" for name in ("kV", "kA", "kP")), gains])
    return "what A_k says\n" + table(rows, right=[1, 2, 3])


def _predicted(c: Mapping[str, Any]) -> str:
    rows: list[Sequence[str]] = [["the controller knows", *(f"{k} [{c['units'][k]}]" for k in c["predicted"])]]
    for pair in zip(*c["predicted"].values(), strict=True):
        name = pair[0]["without"]
        what = {"": "the whole model", "all": "none of the effects"}.get(name, f"all but {name}")
        rows.append([what, *(f"{one['rms']:.4g}" for one in pair)])
    return f"predicted tracking error (RMS, simulated, design {c['design']})\n" + table(rows, right=[1, 2])
