"""The paper's figures 1 to 6, drawn anew, with the numbers of 4 and 5 beside them, and what goes beyond them.

Every number comes from the shipped models `dc_motor` and `bouc_wen`; only the inputs, which the model files do not
hold, are set here. Figures 4 to 6 also show the operating point at the predicted midpoint.
Source: *Linearization Modeling for Non-smooth Dynamical Systems with Approximated Scalar Sign Function*.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from signlin_ros.errors import InputError
from signlin_ros.figures import line, motor, oscillator, sign


def make_figures(directory: str | Path) -> dict[str, Any]:
    """Write the figures (PNG) and the numbers of figures 4 and 5 (JSON) to a folder; return what was written.

    Returns ``{"files": [...], "figure_4": numbers, "figure_5": numbers}``. Raises `MissingExtraError` without
    matplotlib, `InputError` where the folder cannot be written.
    """
    folder = Path(directory)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make {folder}: {error.strerror}") from error
    files = [*_sign_and_line(folder)]
    numbers = {}
    for name, draw in (("figure_4", _motor), ("figure_5", _oscillator)):
        pictures, numbers[name] = draw(folder)
        files += [*pictures, _written(folder / f"{name}.json", numbers[name])]
    return {"files": sorted(map(str, files)), **numbers}


def _sign_and_line(folder: Path) -> list[Path]:
    drawings = {
        "figure_1.png": sign.draw_values,
        "figure_2.png": sign.draw_derivative,
        "figure_3.png": line.draw_lines,
        "beyond_sign.png": sign.draw_uses,
    }
    for name, draw in drawings.items():
        draw(folder / name)
    return [folder / name for name in drawings]


def _motor(folder: Path) -> tuple[list[Path], dict[str, Any]]:
    runs, path = motor.run_motor(), folder / "figure_4.png"
    motor.draw_motor(path, runs)
    return [path], motor.motor_numbers(runs)


def _oscillator(folder: Path) -> tuple[list[Path], dict[str, Any]]:
    runs = oscillator.run_oscillator()
    errors = oscillator.errors_by_period(runs)
    loops, time, order = (folder / name for name in ("figure_5.png", "figure_6.png", "beyond_order.png"))
    oscillator.draw_loops(loops, runs)
    oscillator.draw_time(time, runs)
    oscillator.draw_order(order, errors)
    return [loops, time, order], oscillator.oscillator_numbers(runs, errors)


def _written(path: Path, numbers: Mapping[str, Any]) -> Path:
    text = json.dumps(numbers, indent=2, allow_nan=False, ensure_ascii=False)
    try:
        path.write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}") from error
    return path
