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


def forward_table(content: Mapping[str, Any]) -> str:
    """Return the table of what short forward simulations of unseen motion say, '' where there were none."""
    own = {name: joint["forward"] for name, joint in content["joints"].items() if joint.get("forward")}
    if not own:
        return ""
    laws = [(e["effect"], e["forward"]["says"]) for e in content["ranking"] if e["forward"]]
    rows = []
    for name, ahead in own.items():
        says = [f"{law.rpartition('.')[2]}: {what}" for law, what in laws if law.rpartition(".")[0] == name]
        rows.append([name, ahead["unit"], _number(ahead["basic"]), _number(ahead["model"]), ", ".join(says)])
    window = next(iter(own.values()))["window_s"]
    rows += [["robot", "", "", "", f"{law}: {what}"] for law, what in laws if "." not in law]
    above = f"Errors of the velocities over {window:g} s ahead of measured states, RMS, on data that no fit saw"
    return f"{above}\n{table([['joint', '', '+ friction', 'model', 'says'], *rows])}"


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
    tables = (joints_table(content), forward_table(content))
    parts = (f"{content['verdict']}", said, *tables, notes, cannot_text(content))
    return "\n\n".join(part for part in parts if part)


__all__ = ["compare_text", "diagnose_text"]
