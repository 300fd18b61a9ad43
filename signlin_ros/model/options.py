"""The options of a model, each with the check of what a model file says of it, and keys that are not of the model."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from signlin_ros import sign
from signlin_ros.errors import InputError, ModelError, suggest
from signlin_ros.names import TIME_NAMES
from signlin_ros.par import Par

METHODS = ("optimal", "termwise", "jacobian")
ARM_METHODS = ("per_joint", "jacobian")
"""How an arm is linearized: the others depend on where the zeros of its joints are."""
OPERATING_POINTS = ("start", "midpoint")
AXIS_KINDS = ("rotary", "linear")
DEFAULT_TOLERANCE = 0.05
"""By how much base parameters may be off, where a model does not say."""
INPUT_HOLDS = {"forward": 0.0, "centred": 0.5, "backward": 1.0}
"""By how many steps an input precedes its sample: a command that is held; samples of what goes on in between; what was
logged beside the state that it led to."""
AUTO, LINEAR = "auto", "linear"
"""An input that acts as the records show, and one that is interpolated between its samples (a first-order hold)."""
NAMED_HOLDS = (AUTO, *INPUT_HOLDS, LINEAR)
"""What a model file may say of how an input acts between its samples, beside a number of steps."""
RESERVED_KEYS = ("use_sim_time", "qos_overrides", "start_type_description_service")
"""Keys of ROS 2 itself, accepted everywhere."""
NODE_KEYS = (
    *("publish_rate", "noise", "seed", "input_signal", "amplitude", "input_period", "joint_name"),
    "watchdog",
    *("command", "limits", "margin", "runs", "pause", "ramp", "output", "first_record"),
    *("state_source", "state_timeout", "input_timeout", "stamps", "ignore", "record", "rate", "loop", "publish_clock"),
    *("design", "track", "control_period", "limit", "loop_delay", "largest_speed", "bandwidth", "damping", "integral"),
    *("tolerance_at_rest", "floor", "friction_share", "turning", "reference_timeout", "model_timeout"),
    *("needs_model", "runaway", "after_loss"),
    *(
        "autostart",
        "observer",
        "model_file",
        "linearizer",
        "keep",
        "window",
        "learn",
        "warn_above",
        "most_rows",
        "plot",
        "folder",
    ),
)
"""Keys of the nodes (docs/nodes), accepted by every verb."""


def _number(value: Any, where: str, low: float, high: float, unit: str = "", positive: bool = False) -> float:
    return Par(unit, 0.0, low, high, "", positive=positive).check(value, where)


def _choice(allowed: tuple[str, ...]) -> Callable[[Any, str], str]:
    def check(value: Any, where: str) -> str:
        if value not in allowed:
            raise ModelError(f"{where}: found {value!r}; allowed: {', '.join(allowed)}{suggest(str(value), allowed)}")
        return str(value)

    return check


def _boolean(value: Any, where: str) -> bool:
    if not isinstance(value, bool):
        raise ModelError(f"{where}: found {value!r}; allowed: true or false")
    return value


def _names(value: Any, where: str) -> tuple[str, ...]:
    if not isinstance(value, (list, tuple)) or not all(isinstance(item, str) for item in value):
        raise ModelError(f"{where}: found {value!r}; allowed: a list of names")
    return tuple(value)


def _table(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise ModelError(f"{where}: found {value!r}; allowed: a mapping such as {{name: value}}")
    return {str(name): item for name, item in _flat(value)}


def _flat(value: Mapping[Any, Any], prefix: str = "") -> Any:
    """Yield dotted names, so that ``{bouc_wen_hysteresis: {h: 0.1}}`` names the state ``bouc_wen_hysteresis.h``."""
    for name, item in value.items():
        if isinstance(item, Mapping):
            yield from _flat(item, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", item


def _number_table(low: float, positive: bool = False) -> Callable[[Any, str], dict[str, float]]:
    def check(value: Any, where: str) -> dict[str, float]:
        items = _table(value, where).items()
        return {name: _number(item, f"{where}.{name}", low, math.inf, positive=positive) for name, item in items}

    return check


def _signals(value: Any, where: str) -> dict[str, str]:
    table = dict(_table(value, where))
    for name, item in table.items():
        if isinstance(item, (int, float)) and not isinstance(item, bool) and math.isfinite(item):
            column = isinstance(item, int) and item > 0 and name not in TIME_NAMES
            table[name] = str(item) if column else repr(float(item))
        elif not isinstance(item, str) or not item.strip():
            allowed = "a column's name or number, a formula of columns, or /topic.field[...]; for t also the s from row"
            allowed += " to row, for an input also a number, 0.0, that it is throughout"
            raise ModelError(f"{where}.{name}: found {item!r}; allowed: {allowed}")
    return table


def _tolerance(value: Any, where: str) -> float | dict[str, float]:
    if isinstance(value, Mapping):
        return _number_table(0.0)(value, where)
    return _number(value, where, 0.0, 10.0)


def _order(value: Any, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value or abs(value) == math.inf:
        raise ModelError(f"{where}: found {value!r}; allowed: a whole number from 1 to {sign.MAX_ORDER}")
    try:
        return sign.check_order(value)  # type: ignore[arg-type]
    except InputError as error:
        raise ModelError(str(error)) from error


def _hold(value: Any, where: str) -> str | float:
    if isinstance(value, str) and value in (*NAMED_HOLDS, "held"):
        return "forward" if value == "held" else value
    if isinstance(value, (int, float)) and not isinstance(value, bool) and 0.0 <= value <= 1.0:
        return next((name for name, early in INPUT_HOLDS.items() if early == value), float(value))
    allowed = f"{', '.join(NAMED_HOLDS)}, or by how many steps it precedes its sample, 0 to 1"
    raise ModelError(f"{where}: found {value!r}; allowed: {allowed}{suggest(str(value), NAMED_HOLDS)}")


MODEL_OPTIONS: dict[str, Callable[[Any, str], Any]] = {
    "sign_order": _order,
    "sign_scale": lambda v, w: _number(v, w, 0.0, 1e12),
    "operating_range": _number_table(0.0, positive=True),
    "linearization": _choice((*METHODS, "per_joint")),
    "operating_point": _choice(OPERATING_POINTS),
    "input_hold": _hold,
    "update_period": lambda v, w: _number(v, w, 0.0, 3600.0, "s", positive=True),
    "state_weights": _number_table(0.0),
    "initial_state": _number_table(-math.inf),
    "tolerance": _tolerance,
    "frozen": _names,
    "signals": _signals,
    "effect_files": _names,
    "with_position": _boolean,
    "with_load_torque": _boolean,
    "with_inputs": _names,
    "per_record": _names,
    "axis": _choice(AXIS_KINDS),
    "gear": lambda v, w: _number(v, w, 0.0, 1e6, positive=True),
}


__all__ = [
    "ARM_METHODS",
    "AUTO",
    "AXIS_KINDS",
    "DEFAULT_TOLERANCE",
    "INPUT_HOLDS",
    "LINEAR",
    "METHODS",
    "MODEL_OPTIONS",
    "NAMED_HOLDS",
    "NODE_KEYS",
    "OPERATING_POINTS",
    "RESERVED_KEYS",
]
