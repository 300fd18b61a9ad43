"""Tables and sentences of an arm, for the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.arms.told import CANNOT
from signlin_ros.console.tables import table

_ROWS = ("as_given", "rigid", "basic", "model")


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def joints_table(content: Mapping[str, Any]) -> str:
    """Return the table joint x (URDF as given, rigid refit, basic, model), the band said above."""
    joints = content["joints"]
    rows = [
        [name, own["unit"], _number(own["effort"]), *(_number(own[row]) for row in _ROWS), ", ".join(own["effects"])]
        for name, own in joints.items()
    ]
    head = [
        "joint",
        "",
        "effort",
        "URDF",
        "rigid refit",
        "+ friction",
        "model",
        "named" if "verdict" in content else "",
    ]
    above = f"Left of the efforts, RMS below {content['band_hz']:g} Hz, on data that no fit saw"
    return f"{above}\n{table([head, *rows])}"


def basic_table(content: Mapping[str, Any]) -> str:
    """Return the basic friction of every joint, fitted to all of DATA."""
    rows = []
    for name, own in content["joints"].items():
        values = own["basic_parameters"]
        rows.append([name, *(f"{v['value']:.4g} {v['unit']}" for v in values.values())])
    head = ["joint", "viscous", "Coulomb", "offset", "motor inertia"]
    return f"Basic friction, fitted to all of DATA\n{table([head, *rows])}"


def cannot_text(content: Mapping[str, Any]) -> str:
    """Return the list of what cannot be told."""
    lines = [f"- {name}: {why}" for name, own in content["joints"].items() for why in own["cannot_tell"]]
    return "\n".join(["Cannot be told:", *lines, *(f"- {why}" for why in CANNOT)])


def compare_text(content: Mapping[str, Any]) -> str:
    """Return the text of `compare`."""
    notes = "\n".join(content["notes"])
    return "\n\n".join(
        part for part in (joints_table(content), basic_table(content), notes, cannot_text(content)) if part
    )


def diagnose_text(content: Mapping[str, Any]) -> str:
    """Return the text of `diagnose`, `add` and `refine`."""
    notes = "\n".join(content["notes"])
    said = "\n".join(content["sentences"])
    parts = (f"{content['verdict']}", said, joints_table(content), notes, cannot_text(content))
    return "\n\n".join(part for part in parts if part)


__all__ = ["compare_text", "diagnose_text"]
