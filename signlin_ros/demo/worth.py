"""What published models are worth: each held against what the plant did in the next update period."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from signlin_ros.demo.processes import PUBLISH_RATE
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.predict import without_dry_friction
from signlin_ros.simulation import simulate

if TYPE_CHECKING:
    from signlin_ros.nodes.listen import Heard
    from signlin_ros.nodes.told import Update

Array = NDArray[np.float64]
MAX_STATE_GAP = 0.03
"""Seconds between two states above which a prediction is not judged: a busy machine lost too much in between."""


@dataclass(frozen=True)
class DemoRecord:
    """States x (T, n) on the plant's own time grid t (T,) in s, and u (T, m) held from each sample to the next."""

    t: Array
    x: Array
    u: Array


@dataclass(frozen=True)
class Window:
    """One published model, the samples ``part`` it is held against, and the speeds (S,) predicted for them.

    ``errors`` (S - 1,) leave the first sample out, where all agree.
    """

    time: float
    update: Update
    part: slice
    speeds: Mapping[str, Array]
    errors: Mapping[str, Array]


def on_grid(heard: Heard) -> DemoRecord:
    """Return the plant's published states on its own time grid: the publishers' stamps jitter, the plant does not.

    The input that comes with a state is the one that led to it.
    """
    phase = np.angle(np.mean(np.exp(2j * np.pi * PUBLISH_RATE * heard.t))) / (
        2 * np.pi
    )  # where in a step most are published
    late = (PUBLISH_RATE * heard.t - phase + 0.5) % 1.0 - 0.5
    early = phase + float(np.quantile(late, 0.05)) - 0.1  # a state belongs to the step before it, however late it is
    steps, first = np.unique(np.floor(PUBLISH_RATE * heard.t - early).astype(int), return_index=True)
    steps -= steps[0]
    led = heard.u[np.maximum(np.searchsorted(heard.u_t, heard.t[first], side="right") - 1, 0)]
    return DemoRecord(steps / PUBLISH_RATE, heard.x[first], np.vstack([led[1:], led[-1:]]))


def predict_linear(A: Array, B: Array, c: Array, record: DemoRecord, part: slice) -> Array:
    """Return the states (S, n) that x' = A x + B u + c predicts for the samples of ``part`` from its first one."""
    from scipy.linalg import expm

    n, m = B.shape
    block = np.zeros((n + m + 1, n + m + 1))
    block[:n] = np.hstack([A, B, c[:, None]])
    steps = np.diff(record.t[part])
    flows = {dt: expm(block * dt)[:n] for dt in set(steps.tolist())}
    states = [record.x[part.start]]
    for dt, u in zip(steps.tolist(), record.u[part], strict=False):
        states.append(flows[dt] @ np.concatenate([states[-1], u, [1.0]]))
    return np.array(states)


class Rivals:
    """What the published models are held against, all from the same state and input."""

    def __init__(self, model: Model) -> None:
        self.model = model
        bare = without_dry_friction(model)
        self._linear = {
            "no friction": Linearizer(bare.with_options(operating_point="start")),
            "jacobian": Linearizer(model.with_options(operating_point="start"), "jacobian"),
        }

    def speeds(self, record: DemoRecord, part: slice, update: Update) -> dict[str, Array]:
        """Return the speed (S,) predicted by the published model, by its rivals, and by the exact model."""
        column, result = self.model.states.index(self.model.plant.velocity), update.result
        found = {"published": predict_linear(result.A, result.B, result.c, record, part)}
        for name, linearizer in self._linear.items():
            rival = linearizer(record.x[part.start], result.u)
            found[name] = predict_linear(rival.A, rival.B, rival.c, record, part)
        exact = simulate(self.model, record.t[part], record.u[part], record.x[part.start])
        return {name: states[:, column] for name, states in (found | {"exact": exact.x}).items()}


def windows(rivals: Rivals, record: DemoRecord, models: Sequence[tuple[float, Update]]) -> list[Window]:
    """Return a window of one update period for each published model that has one in the record without a gap."""
    period, column = rivals.model.update_period, rivals.model.states.index(rivals.model.plant.velocity)
    found = []
    for stamp, update in models:
        first = int(np.searchsorted(record.t, stamp + 1e-9, side="right")) - 1
        last = int(np.searchsorted(record.t, record.t[max(first, 0)] + period - 1e-9))
        if first < 0 or last >= record.t.size:
            continue
        part = slice(first, last + 1)
        if np.diff(record.t[part]).max() > MAX_STATE_GAP:
            continue
        speeds = rivals.speeds(record, part, update)
        errors = {name: (speed - record.x[part, column])[1:] for name, speed in speeds.items()}
        found.append(Window(stamp, update, part, speeds, errors))
    return found


def rms(found: Sequence[Window], name: str) -> float:
    """Return the RMS of an error over all samples of all windows."""
    return float(np.sqrt(np.mean(np.concatenate([window.errors[name] for window in found]) ** 2)))


def typical(found: Sequence[Window], name: str) -> float:
    """Return the median over the windows of their RMS errors."""
    return float(np.median([rms([window], name) for window in found]))


def largest_difference(model: Model, found: Sequence[Window]) -> float:
    """Return how far a published A_k, B_k or c is at most from the library's at the stated x_k, u_k."""
    core = Linearizer(model.with_options(operating_point="start"))
    largest = 0.0
    for window in found:
        ours, theirs = core(window.update.result.x, window.update.result.u), window.update.result
        pairs = ((ours.A, theirs.A), (ours.B, theirs.B), (ours.c, theirs.c))
        largest = max(largest, *(float(np.abs(a - b).max()) for a, b in pairs))
    return largest


__all__ = [
    "MAX_STATE_GAP",
    "Array",
    "DemoRecord",
    "Rivals",
    "Window",
    "largest_difference",
    "on_grid",
    "predict_linear",
    "rms",
    "typical",
    "windows",
]
