"""A linearization as the mapping of schemas/linearize.json, and as text with units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from signlin_ros.compiled import surface_scales, weights
from signlin_ros.console.tables import number, per_second, table
from signlin_ros.linearization import Linearization
from signlin_ros.model import Model
from signlin_ros.sign import valid_reach


def linearize_content(model: Model, result: Linearization) -> dict[str, Any]:
    """Return a linearization as the JSON object of schemas/linearize.json."""
    arrays = {name: getattr(result, name).tolist() for name in ("A", "B", "c", "x", "u", "f")}
    return arrays | {
        "states": list(model.states),
        "inputs": list(model.inputs),
        "method": result.method,
        "sign_order": model.sign_order,
        "sign_scale": surface_scales(model),
        "in_valid_range": result.in_valid_range,
        "delay": result.delay,
    }


def linearize_warnings(model: Model, result: Linearization) -> list[str]:
    """Return warnings on a linear model: outside the valid range, position in the norm."""
    found = []
    if not result.in_valid_range:
        limit = valid_reach(model.sign_order)
        limits = ", ".join(f"|{name}| <= {scale * limit:.4g}" for name, scale in surface_scales(model).items())
        found.append(
            f"the operating point is outside the valid range of sign_j at order {model.sign_order}: {limits};"
            " raise sign_scale or sign_order, or set sign_scale: 0.0 with an operating_range"
        )
    position = model.plant.position
    if (
        result.method == "optimal"
        and position in model.states
        and weights(model)[model.states.index(position)] > 0
        and model.parameters.get("k", 0.0) == 0.0
    ):
        found.append(
            f"{position} carries weight in the optimal linearization, so A depends on where {position} is 0;"
            f" state_weights: {{{position}: 0.0}} in the model file takes it out"
        )
    return found


def linearize_text(model: Model, content: dict[str, Any]) -> str:
    """Return a linearization as text: the operating point with units, then A, B and c with their names."""
    c, states, inputs, units = content, content["states"], content["inputs"], model.units
    scale = ", ".join(f"{name}: {value:g}" for name, value in content["sign_scale"].items()) or "no surfaces"
    head = [
        f"x' = A x + B u + c   {model.plant.name} ({model.source})",
        f"method {content['method']}, sign_order {content['sign_order']}, sign_scale {{{scale}}}",
        f"{'inside' if c['in_valid_range'] else 'OUTSIDE'} the valid range; delay {c['delay']:g} s",
    ]
    point = [["", "value", "", "f"]]
    point += [
        [n, number(v), units[n], f"{number(f)} {per_second(units[n])}"]
        for n, v, f in zip(states, content["x"], content["f"], strict=True)
    ]
    point += [[n, number(v), units[n], ""] for n, v in zip(inputs, content["u"], strict=True)]
    matrices = [
        _matrix("A", states, states, content["A"]),
        _matrix("B", states, inputs, content["B"]),
        _matrix("c", states, [""], [[value] for value in content["c"]]),
    ]
    return "\n\n".join(["\n".join(head), "operating point\n" + table(point, right=[1]), *matrices])


def _matrix(name: str, rows: Sequence[str], columns: Sequence[str], values: list[list[float]]) -> str:
    cells = [["", *columns]] if any(columns) else []
    cells += [[row, *map(number, line)] for row, line in zip(rows, values, strict=True)]
    return f"{name}\n" + table(cells, right=range(1, len(columns) + 1))


__all__ = ["linearize_content", "linearize_text", "linearize_warnings"]
