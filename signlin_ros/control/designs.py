"""Designs of controllers by name: from a model and weights to a law and its feed-forward.

What A_k is for is decided here. A raw A_k near standstill has the secant of a sign in it, mu sign_j(v)/v, which is a
huge damping where there is none: it takes the feedback away, and as a feed-forward it asks for many times the friction.
So a design that uses A_k keeps the speed above a floor and the feed-forward below the friction (`secants`); the raw
ones are here to be measured, not to be used.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control import law as law_module
from signlin_ros.control.constants import Constants, constants
from signlin_ros.control.drive import NO_SLOT, Drive, friction_free
from signlin_ros.control.inverse import feed_forward
from signlin_ros.control.law import ControlLaw
from signlin_ros.control.lqr import Weights, lqr_gains, lqr_rows, pid_gains
from signlin_ros.control.reference import Profile
from signlin_ros.errors import InputError, choices, suggest
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model

Array = NDArray[np.float64]
DESIGN_SPEEDS = 8
"""Speeds at which gains are designed."""


@dataclass(frozen=True)
class Task:
    """What is asked of a controller, whatever its design.

    Parameters
    ----------
    position : whether the position is tracked, else the speed.
    period, delay : s between updates; s from a sample until its input acts.
    limit : largest |u|.
    speed : largest speed of the references.
    tolerance : error that need not be removed where the reference stands still.
    least : the shortest delay in s where it is not known exactly, and ``delay`` is the longest; None: it is.
    """

    position: bool
    period: float
    delay: float
    limit: float
    speed: float
    tolerance: float = 0.0
    least: float | None = None

    @property
    def delays(self) -> tuple[float, float]:
        """The shortest and the longest delay in s."""
        return (self.delay if self.least is None else min(self.least, self.delay)), self.delay

    @property
    def believed(self) -> float:
        """The delay in s that gains are made for: of those that are possible, one that serves all of them."""
        shortest, longest = self.delays
        return shortest + BELIEVED * (longest - shortest)


BELIEVED = 0.75
"""Where between the shortest and the longest delay gains are made for: there a drive that is an inertia keeps its
margins at the largest bandwidth."""


@dataclass(frozen=True)
class Tuning:
    """What is chosen for a design: the weights, and what some designs have beside them.

    ``floor``: speed, as a share of the largest, below which A_k is not taken, and within which the friction along the
    reference fades; ``friction``: share of the friction that is fed forward; ``turning``: see `ControlLaw`.
    """

    weights: Weights
    floor: float = 0.02
    friction: float = 1.0
    turning: float = 0.0


@dataclass(frozen=True)
class Design:
    """A design: its name, what it is in a sentence, which of `Tuning` it has, and how its law is made."""

    name: str
    what: str
    free: tuple[str, ...]
    law: Callable[[Model, Task, Tuning], ControlLaw]
    feed: str = "friction"
    """What is fed forward along the reference: ``none``, ``linear`` (friction-free model) or ``friction`` (all)."""


# --------------------------------------------------------------------------- what a model says


class _Key:
    """A model as the key of a cache: by what it says."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self._text = str(model.to_dict())

    def __hash__(self) -> int:
        return hash(self._text)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self._text == other._text


_keys: dict[int, _Key] = {}
"""The keys of models by their identity, which they keep alive."""


def _key(model: Model) -> _Key:
    if id(model) not in _keys:
        if len(_keys) > 500:
            _keys.clear()
        _keys[id(model)] = _Key(model)
    return _keys[id(model)]


@functools.lru_cache(maxsize=512)
def _bare(key: _Key) -> Model:
    return friction_free(key.model)


@functools.lru_cache(maxsize=512)
def _known(key: _Key, position: bool, speed: float) -> Constants:
    return constants(Drive.of(key.model, with_position=position), speed)


@functools.lru_cache(maxsize=512)
def _linearizer(key: _Key, method: str | None) -> Linearizer:
    return Linearizer(key.model.with_options(operating_point="start"), method)


def known(model: Model, task: Task, bare: bool = False) -> Constants:
    """Return the constants of a model, or of its friction-free part, for the speeds of a task."""
    key = _key(model)
    return _known(_key(_bare(key)) if bare else key, task.position, task.speed)


def friction_free_part(model: Model) -> Model:
    """Return `friction_free` of a model, once for each."""
    return _bare(_key(model))


def jacobian(model: Model, x: Array) -> tuple[Array, Array]:
    """Return the Jacobian A (n, n) and B (n, m) of a model at a state x (n,) without input."""
    result = _linearizer(_key(model), "jacobian").batch(x[None, :])
    return result.A[0], result.B[0]


@dataclass(frozen=True)
class Reduced:
    """A_k, B_k, c at P points in terms of the input, with the current as it settles: u = kV v + kA a + kP q + k0.

    kV, kA, kP, k0 (P,); ``in_valid_range`` (P,) as of the linearization. Own states of effects are held.
    """

    kV: Array
    kA: Array
    kP: Array
    k0: Array
    in_valid_range: NDArray[np.bool_]


def reduced(model: Model, x: Array, method: str | None = None) -> Reduced:
    """Return the drive's constants in A_k at states x (P, n)."""
    drive = Drive.of(model)
    result = _linearizer(_key(model), method).batch(x)
    v, B, A, c = drive.velocity, result.B[:, :, 0], result.A, result.c
    share = (
        np.zeros(len(x)) if drive.current == NO_SLOT else A[:, v, drive.current] / A[:, drive.current, drive.current]
    )
    i = v if drive.current == NO_SLOT else drive.current
    gone = share[:, None]
    row, effect, rest = A[:, v] - gone * A[:, i], B[:, v] - share * B[:, i], c[:, v] - share * c[:, i]
    stiffness = row[:, drive.position] if drive.position != NO_SLOT else np.zeros(len(x))
    return Reduced(-row[:, v] / effect, 1.0 / effect, -stiffness / effect, -rest / effect, result.in_valid_range)


def secants(model: Model, speeds: Array, method: str | None = None) -> Reduced:
    """Return the drive's constants in A_k at speeds (P,), at the state that has this speed and is 0 otherwise."""
    x = np.zeros((speeds.size, len(model.states)))
    x[:, Drive.of(model).velocity] = speeds
    return reduced(model, x, method)


def _grid(task: Task, lowest: float) -> Array:
    return np.concatenate([[0.0], np.geomspace(max(lowest, 1e-6) * task.speed, 1.5 * task.speed, DESIGN_SPEEDS - 1)])


# --------------------------------------------------------------------------- laws


def _law(task: Task, grid: Array, gains: Array, **more: object) -> ControlLaw:
    settings = (task.period, task.limit, task.position, task.tolerance)
    return ControlLaw(grid, gains, *settings, **more)  # type: ignore[arg-type]


def _two(row: Array) -> tuple[Array, Array]:
    return np.array([0.0, 1.0]), np.vstack([row, row])


def _linear(model: Model, task: Task, tuning: Tuning, bare: bool = True) -> ControlLaw:
    c = known(model, task, bare)
    gains = lqr_gains(c.kV, c.kA, c.kP, tuning.weights, task.period, task.believed, task.position)
    return _law(task, *_two(gains.row), width=tuning.floor * task.speed)


def _along(model: Model, task: Task, tuning: Tuning) -> ControlLaw:
    return _linear(model, task, tuning, bare=False)


def _turning(model: Model, task: Task, tuning: Tuning) -> ControlLaw:
    return replace(_along(model, task, tuning), turning=tuning.turning)


def _pid(model: Model, task: Task, tuning: Tuning) -> ControlLaw:
    gains = pid_gains(known(model, task, bare=True), tuning.weights, task.position)
    return _law(task, *_two(gains.row), width=tuning.floor * task.speed)


def _scheduled(model: Model, task: Task, tuning: Tuning, floor: float, by_state: bool) -> ControlLaw:
    """Return gains designed with A_k at each speed of a grid, not below the floor."""
    grid = _grid(task, 1e-3)
    found = secants(model, np.maximum(grid, floor * task.speed))
    kP = known(model, task, bare=True).kP
    rows = lqr_rows(found.kV, found.kA, kP, tuning.weights, task.period, task.believed, task.position)
    return _law(task, grid, rows, by_state=by_state, width=tuning.floor * task.speed)


def _at_reference(model: Model, task: Task, tuning: Tuning) -> ControlLaw:
    return _scheduled(model, task, tuning, tuning.floor, by_state=False)


def _state_tables(model: Model, task: Task, tuning: Tuning, method: str | None = None) -> tuple[Array, Array]:
    """Return a grid, and of the friction in A_k at the measured speed the slope and the level (G, 2)."""
    grid = _grid(task, 1e-3)
    whole, bare = secants(model, grid, method), secants(_bare(_key(model)), grid, method)
    slope = whole.kV - bare.kV
    level = slope * grid + (whole.k0 - bare.k0 if method == "jacobian" else 0.0)
    return grid, tuning.friction * np.column_stack([slope, level])


def _at_state_clipped(model: Model, task: Task, tuning: Tuning) -> ControlLaw:
    grid, tables = _state_tables(model, task, tuning)
    tables[:, 1] = np.maximum.accumulate(tables[:, 1])
    base = _linear(model, task, tuning)
    rows = np.repeat(base.gains[:1], grid.size, axis=0)
    return replace(base, grid=grid, gains=rows, tables=tables, added=law_module.CLIPPED)


def _at_state_raw(model: Model, task: Task, tuning: Tuning) -> ControlLaw:
    law = _scheduled(model, task, tuning, 0.0, by_state=True)
    grid, tables = _state_tables(model, task, tuning)
    return replace(law, grid=grid, tables=tables, added=law_module.RAW)


def _tangent(model: Model, task: Task, tuning: Tuning) -> ControlLaw:
    grid, tables = _state_tables(model, task, tuning, "jacobian")
    base = _linear(model, task, tuning)
    rows = np.repeat(base.gains[:1], grid.size, axis=0)
    return replace(base, grid=grid, gains=rows, tables=tables, added=law_module.TANGENT_ADDED)


DESIGNS: dict[str, Design] = {
    design.name: design
    for design in (
        Design("pid", "PI (speed) or PID (position) alone", (), _pid, "none"),
        Design("friction_free", "friction-free LQR with integral action", (), _linear, "linear"),
        Design("pid_friction", "PI(D) with the model's input along the reference", ("floor", "friction"), _pid),
        Design("along_reference", "LQR with the model's input along the reference", ("floor", "friction"), _along),
        Design(
            "turning_integral",
            "the same, and an integral action that turns with the reference's direction",
            ("floor", "friction", "turning"),
            _turning,
        ),
        Design("ak_reference", "gains from A_k at the reference's speed, with a floor", ("floor",), _at_reference),
        Design(
            "ak_state_clipped",
            "friction-free gains, feed-forward from A_k at the measured speed, clipped to the friction",
            ("friction",),
            _at_state_clipped,
            "linear",
        ),
        Design("ak_raw", "gains and feed-forward from A_k at the measured speed, raw", (), _at_state_raw, "linear"),
        Design("jacobian", "friction-free gains, Jacobian and c as feed-forward", ("friction",), _tangent, "linear"),
    )
}
"""Every design by its name, the ones that a node takes and those that are measured beside them."""
DEFAULT_DESIGN = "along_reference"
CALM = 0.8
"""Bandwidth by default, as a multiple of 1 / (period + delay)."""


def default_tuning(period: float, delay: float) -> Tuning:
    """Return a tuning that suits any drive: a bandwidth that the delay of the loop leaves room for."""
    return Tuning(Weights(bandwidth=CALM / (period + delay)))


def find_design(name: str) -> Design:
    """Return the design of a name; raise `InputError` with the nearest."""
    if name not in DESIGNS:
        raise InputError(f"design: found {name!r}; allowed: {choices(DESIGNS)}{suggest(name, DESIGNS)}")
    return DESIGNS[name]


def feed_along(design: Design, model: Model, task: Task, tuning: Tuning, profile: Profile, count: int) -> Array:
    """Return the feed-forward input (count,) of a design along a profile."""
    if design.feed == "none":
        return np.zeros(count)
    linear = _fed(_key(_bare(_key(model))), task, profile, count, 1e-3)
    if design.feed == "linear":
        return linear
    width = tuning.floor if "floor" in design.free else 0.01
    full = _fed(_key(model), task, profile, count, float(f"{width:.1g}"))
    return np.asarray(linear + tuning.friction * (full - linear))


_feeds: dict[tuple[object, ...], tuple[Profile, Array]] = {}
"""Feed-forwards by what they are for; a profile is kept so that no other one gets its identity."""


def _fed(key: _Key, task: Task, profile: Profile, count: int, width: float) -> Array:
    index = (key, task.position, task.period, task.delay, task.speed, id(profile), count, width)
    if index not in _feeds:
        if len(_feeds) > 500:
            _feeds.clear()
        drive = Drive.of(key.model, with_position=task.position)
        found = feed_forward(drive, profile, task.period, count, width * task.speed, task.delay)
        _feeds[index] = profile, found
    return _feeds[index][1]
