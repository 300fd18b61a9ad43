"""What an engineer sets: gains, feed-forward constants, and what each effect in the model is worth to a controller."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control import CONTROL_PERIOD
from signlin_ros.control.constants import Constants
from signlin_ros.control.designs import (
    DEFAULT_DESIGN,
    DESIGNS,
    Design,
    Task,
    Tuning,
    default_tuning,
    feed_along,
    known,
    reduced,
)
from signlin_ros.control.drive import NO_FORCES, NO_SLOT, Drive, friction_free
from signlin_ros.control.holding import calmed, holding, margins_at
from signlin_ros.control.lqr import FeedbackGains, lqr_gains, pid_gains
from signlin_ros.control.reference import Profile, sine
from signlin_ros.control.tracking import TrackingBench
from signlin_ros.model import Model
from signlin_ros.sign import valid_reach

Array = NDArray[np.float64]
SPEED_SHARES = (0.01, 0.1, 0.5, 1.0)
"""Shares of the largest speed at which A_k is looked at where nobody names a point."""
SWING = 4.0
"""Period in s of the reference that the errors are predicted for."""
TRACKING_RTOL = 1e-5


@dataclass(frozen=True)
class Wishes:
    """What gains are asked for: s between updates, delay of the loop in s, largest speed and |u|, a bandwidth.

    None: chosen from the model. The delay is the longest; a loop has to hold with every one from the model's own on.
    """

    period: float = CONTROL_PERIOD
    delay: float | None = None
    speed: float | None = None
    limit: float | None = None
    bandwidth: float | None = None

    def tuning(self, model: Model, position: bool, design: str = DEFAULT_DESIGN) -> Tuning:
        """Return the tuning of a loop: the bandwidth wished for, or the largest that holds there."""
        tuning = default_tuning(self.period, self.delay_of(model))
        return calmed(DESIGNS[design], model, self.task(model, position), tuning, self.bandwidth or 0.0)

    def check(self, model: Model) -> None:
        """Raise `InputError` with the largest bandwidth that holds where the one wished for does not, for a speed."""
        tuning = default_tuning(self.period, self.delay_of(model))
        holding(DESIGNS[DEFAULT_DESIGN], model, self.task(model, False), tuning, self.bandwidth or 0.0)

    def delay_of(self, model: Model) -> float:
        """Return the delay of the loop: one period, and that of the model's input, unless wished otherwise."""
        return self.period + model.delay if self.delay is None else self.delay

    def task(self, model: Model, position: bool) -> Task:
        """Return the task wished for."""
        speed = largest_speed(model) if self.speed is None else self.speed
        limit = largest_input(model) if self.limit is None else self.limit
        return Task(position, self.period, self.delay_of(model), limit, speed, least=model.delay)


def largest_speed(model: Model) -> float:
    """Return the largest speed that a model speaks of: its operating range, or the valid range of sign_j."""
    ranged = model.operating_range.get(model.plant.velocity)
    return float(ranged) if ranged else float((model.sign_scale or 1.0) * valid_reach(model.sign_order))


def largest_input(model: Model) -> float:
    """Return the level at which the model's input saturates; inf where it does not."""
    levels = [use.parameters["u_max"] for use in model.effects.values() if use.type == "input_saturation"]
    return min(levels, default=math.inf)


def gains_content(model: Model, at: Mapping[str, float], wishes: Wishes) -> dict[str, Any]:
    """Return gains and feed-forward as the JSON object of schemas/gains.json; ``at`` names an operating point."""
    drive = Drive.of(model)
    wishes.check(model)
    tuning, task = wishes.tuning(model, position=False), wishes.task(model, position=False)
    whole, bare = known(model, task), known(model, task, bare=True)
    return {
        "model": model.source,
        "input": {"name": model.inputs[0], "unit": drive.input_unit},
        "units": {"speed": drive.speed_unit, "position": drive.position_unit},
        "period": task.period,
        "delay": task.delay,
        "speed": task.speed,
        "weights": {name: getattr(tuning.weights, name) for name in ("bandwidth", "damping", "integral")},
        "feed_forward": _constants(whole),
        "friction_free": _constants(bare),
        "speed_loop": _loop(model, whole, wishes, position=False),
        "position_loop": _loop(model, whole, wishes, position=True),
        "operating_points": _points(model, drive, at, wishes.tuning(model, drive.position != NO_SLOT), task),
        "design": DEFAULT_DESIGN,
        "predicted": {kind: predicted(model, wishes, kind == "position") for kind in ("speed", "position")},
    }


def _constants(found: Constants) -> dict[str, float]:
    return {name: getattr(found, name) for name in ("kS", "kV", "kA", "kP", "kG", "left")}


def _lqr(found: FeedbackGains, position: bool) -> dict[str, Any]:
    place = {"k_q": found.k_q} if position else {}
    return {**place, "k_v": found.k_v, "k_i": found.k_i, "past_inputs": list(found.past)}


def _loop(model: Model, c: Constants, wishes: Wishes, position: bool) -> dict[str, Any]:
    """Return the gains of a loop, each with a bandwidth that it holds, and its largest sensitivity."""
    task = wishes.task(model, position)
    tuned = {name: wishes.tuning(model, position, name) for name in (DEFAULT_DESIGN, "pid")}
    found = lqr_gains(c.kV, c.kA, c.kP, tuned[DEFAULT_DESIGN].weights, task.period, task.believed, position)
    plain = pid_gains(known(model, task, bare=True), tuned["pid"].weights, position)
    pid = {"K_p": plain.k_q, "K_i": plain.k_i, "K_d": plain.k_v} if position else {"K_p": plain.k_v, "K_i": plain.k_i}
    held = {name: _held(DESIGNS[name], model, task, tuning) for name, tuning in tuned.items()}
    return {
        "lqr": {**_lqr(found, position), **held[DEFAULT_DESIGN]},
        "pid" if position else "pi": {**pid, **held["pid"]},
    }


def _held(design: Design, model: Model, task: Task, tuning: Tuning) -> dict[str, float]:
    bandwidth = tuning.weights.bandwidth
    return {"bandwidth": bandwidth, "sensitivity": margins_at(design, model, task, tuning)(bandwidth).sensitivity}


# --------------------------------------------------------------------------- A_k


def _points(model: Model, drive: Drive, at: Mapping[str, float], tuning: Tuning, task: Task) -> list[dict[str, Any]]:
    """Return A_k at the point named, or at some speeds, with the gains of it."""
    if at:
        x = model.state_vector(at)[None, :]
    else:
        x = np.zeros((len(SPEED_SHARES), len(model.states)))
        x[:, drive.velocity] = np.array(SPEED_SHARES) * task.speed
    found = reduced(model, x)
    rows = zip(x, found.kV, found.kA, found.kP, found.in_valid_range, strict=True)
    return [_point(drive, task, tuning, *row) for row in rows]


def _point(
    drive: Drive, task: Task, tuning: Tuning, x: Array, kV: float, kA: float, kP: float, valid: bool
) -> dict[str, Any]:
    """Return one point; a position loop is designed where position is a state, else a speed loop."""
    position = drive.position != NO_SLOT
    gains = lqr_gains(kV, kA, kP, tuning.weights, task.period, task.believed, position)
    return {
        "state": dict(zip(drive.model.states, x.tolist(), strict=True)),
        "kV": float(kV),
        "kA": float(kA),
        "kP": float(kP),
        "in_valid_range": bool(valid),
        "above_floor": bool(abs(x[drive.velocity]) >= tuning.floor * task.speed),
        "loop": "position" if position else "speed",
        "lqr": _lqr(gains, position),
    }


# --------------------------------------------------------------------------- what it is worth


def predicted(model: Model, wishes: Wishes, position: bool) -> list[dict[str, Any]]:
    """Return the error that simulation predicts with the whole model, without each effect, and without them all.

    The plant is the model as it is; only what the controller knows of it differs. The reference is a sine of speed.
    """
    forces = [key for key, use in model.effects.items() if use.type not in NO_FORCES]
    known_by = {"": model, **{key: model.without_effect(key) for key in forces}}
    if len(forces) > 1:
        known_by["all"] = friction_free(model)
    profile = sine(wishes.task(model, position).speed, SWING, cycles=2)
    plant = Drive.of(model, with_position=position)
    return [{"without": name, **_error(plant, profile, one, wishes, position)} for name, one in known_by.items()]


def _error(plant: Drive, profile: Profile, model: Model, wishes: Wishes, position: bool) -> dict[str, float]:
    task, tuning = wishes.task(plant.model, position), wishes.tuning(plant.model, position)
    design = DESIGNS[DEFAULT_DESIGN]
    bench = TrackingBench(plant, profile, task.period, max(task.delay - plant.model.delay, 0.0))
    feed = feed_along(design, model, task, tuning, profile, bench.count)
    run = bench.run(design.law(model, task, tuning), feed, TRACKING_RTOL)
    worst = float(np.max(np.abs(run.error))) if run.finished else math.inf
    return {"rms": _finite(run.rms), "largest": _finite(worst)}


def _finite(value: float) -> float:
    return value if math.isfinite(value) else 1e300
