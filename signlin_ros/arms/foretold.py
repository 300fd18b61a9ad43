"""What short forward simulations say, in JSON and in words."""

from __future__ import annotations

from typing import Any

import numpy as np

from signlin_ros.arms.ahead import WINDOW, Ahead, Witness
from signlin_ros.arms.study import Study


def speed_unit(study: Study, at: int) -> str:
    """Return the unit of a joint's velocity; errors of all joints (-1) are in units of their own."""
    return f"{study.robot.joints[at].position_unit}/s" if at >= 0 else "-"


def foretold_json(ahead: tuple[Ahead, Ahead], i: int, unit: str) -> dict[str, Any]:
    """Return how well a joint's velocity is foretold, by basic friction and by what is proposed."""
    basic, model = (float(found.rms[i]) if np.isfinite(found.rms[i]) else None for found in ahead)
    return {"window_s": WINDOW, "unit": unit, "basic": basic, "model": model}


def forward_json(witness: Witness | None, unit: str) -> dict[str, Any] | None:
    """Return the JSON of what is said of a law; None where it is not simulated."""
    if witness is None:
        return None
    own = {"unit": unit, "without": witness.without, "with": witness.with_, "errors": witness.errors}
    return {"window_s": WINDOW, "windows": witness.windows, **own, "says": witness.says}


def forward_text(witness: Witness | None, unit: str) -> str:
    """Return what is said of a law as the end of its sentence."""
    if witness is None:
        return ""
    unit = "" if unit == "-" else f" {unit}"
    figures = f"error of the velocity {WINDOW:g} s ahead {witness.without:.2g} -> {witness.with_:.2g}{unit}"
    return {
        "confirmed": f"; {figures}",
        "undecided": f"; {figures}, not beyond chance in {witness.windows} windows",
        "in question": f"; but {figures}: in question",
    }[witness.says]


__all__ = ["foretold_json", "forward_json", "forward_text", "speed_unit"]
