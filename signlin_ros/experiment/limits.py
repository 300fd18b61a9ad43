"""What a machine may be asked to do: the largest input, speed, travel, and how fast an input changes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import InputError, choices, suggest
from signlin_ros.fitting.problem import Problem
from signlin_ros.model import Model
from signlin_ros.simulation import Trajectory

Array = NDArray[np.float64]
SLEW, TRAVEL = "slew", "travel"
"""Names of limits beside those of inputs and states: change of the input per s; the way from the start."""


@dataclass(frozen=True)
class Limits:
    """Largest |input|, and by state largest |value|, of a position its distance from the start. ``slew``: change of the
    input per s. ``assumed``: names of those that nobody gave, which are what the first records visited.
    """

    input: float
    states: Mapping[str, float]
    slew: float = np.inf
    assumed: tuple[str, ...] = ()
    position: str = ""
    velocity: str = ""
    names: Mapping[str, float] = field(default_factory=dict)

    def share(self, run: Trajectory) -> tuple[float, str]:
        """Return the largest value of a motion as a part of its limit, and of which."""
        worst, name = 0.0, ""
        for state, most in self.states.items():
            values = self.values(run, state)
            part = float(np.abs(values).max()) / most if values is not None else 0.0
            if not part <= worst:
                worst, name = part, state
        return worst, name

    def values(self, run: Trajectory, name: str) -> Array | None:
        """Return a limited quantity (T,) of a motion, a position from its start; None where there is none."""
        known = (*run.states, *run.outputs)
        if name in known:
            return np.asarray(run[name] - run[name][0]) if name == self.position else run[name]
        if name == self.position and self.velocity in known:
            v = run[self.velocity]
            return np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(run.t))])
        return None

    def wider(self, times: float, name: str) -> Limits:
        """Return the same with one of them so many times as large."""
        if name not in self.states:
            return Limits(
                times * self.input, self.states, times * self.slew, self.assumed, self.position, self.velocity
            )
        states = {**self.states, name: times * self.states[name]}
        return Limits(self.input, states, self.slew, self.assumed, self.position, self.velocity)

    def to_json(self, model: Model) -> dict[str, float]:
        """Return the limits by name."""
        found = {model.inputs[0]: self.input, **self.states}
        return found | ({SLEW: self.slew} if np.isfinite(self.slew) else {})


def limits_of(problem: Problem, given: Mapping[str, float]) -> Limits:
    """Return limits from what was given by name; of the input and of the motion that is measured, else what the first
    records visited. Raises `InputError` for a name that is none, and for a number that is not positive.
    """
    model, plant, own = problem.base, problem.base.plant, dict[str, float]()
    allowed = (*model.inputs, *model.states, *model.outputs, plant.position, plant.velocity, SLEW, TRAVEL)
    allowed = tuple(dict.fromkeys(allowed))
    for name, value in given.items():
        plain = plant.position if name == TRAVEL else name if name in allowed else _canonical(model, name)
        if plain not in allowed:
            raise InputError(f"--limit: unknown name {name!r}; there are: {choices(allowed)}{suggest(name, allowed)}")
        if plain in own:
            raise InputError(f"--limit: {plain} is given twice, once as {name}")
        if not (value > 0.0 and np.isfinite(value)):
            raise InputError(f"--limit: {name}: found {value:g}; allowed: a positive number")
        own[plain] = value
    name, slew, assumed = model.inputs[0], own.pop(SLEW, np.inf), list[str]()
    others = [n for n in own if n in model.inputs and n != name]
    if others:
        raise InputError(f"--limit: {others[0]}: only the first input, {name}, is designed; the others stay 0")
    if name not in own:
        own[name] = max(map(abs, problem.ranges[name]))
        assumed.append(name)
    visited = {plant.velocity} | ({plant.position} if plant.position in problem.channels else set())
    for state in sorted(visited - own.keys()):
        low, high = problem.ranges.get(state, (0.0, 0.0))
        most = max(abs(low), abs(high)) if state == plant.velocity else high - low
        if most > 0.0:
            own[state] = most
            assumed.append(state)
    most = own.pop(name)
    return Limits(most, own, slew, tuple(assumed), plant.position, plant.velocity)


def _canonical(model: Model, name: str) -> str:
    try:
        return model.canonical(name)
    except InputError:
        return ""


__all__ = ["Limits", "limits_of"]
