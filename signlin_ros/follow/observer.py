"""Observers of a model that is wrong by a given share.

A Kalman filter takes the nonlinear model for its prediction and a constant gain, designed at the model's median
slopes with a disturbance on every equation of the plant that is not mere kinematics. The disturbance has the size of
``trust`` times what the equation usually holds, for `MODEL_ERROR_PERSISTENCE` seconds. A large ``trust`` follows the
measurements, a small one the model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from signlin_ros.follow.data import Segment
from signlin_ros.follow.freerun import MIN_START_SAMPLES, fitted_start
from signlin_ros.follow.tracking import (
    TrackedRun,
    Tracker,
    discrete,
    driven,
    mean_square,
    measured_states,
    predicted_covariance,
)
from signlin_ros.model import Model
from signlin_ros.noise import Noise

Array = NDArray[np.float64]

MODEL_ERROR_PERSISTENCE = 0.1
"""How long, in s, an error of the model lasts in the observer's picture of it."""
OBSERVER_TRUSTS = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
"""Shares by which a model may be wrong, from hardly to wholly."""
SLOPE_SAMPLES = 2000
"""Slopes are taken at about this many samples."""
MAX_START_NOISE, MAX_START_RMS = 6.0, 3.0
"""An initial state is at most so many standard deviations of its noise, or so many RMS, away from what is known."""


@dataclass(frozen=True)
class ObserverDesign:
    """A constant observer: transition A (n, n), outputs C (ny, n), gain K (n, ny), and what smoothing needs.

    ``back`` (n, n) and ``weigh`` (n, ny): r_(k-1) = weigh e_k + back r_k; ``spread`` (n, n): disturbance of the states'
    rates = spread r; ``step`` (n, n): what a disturbance of the rates, held between two samples, adds to the state.
    """

    A: Array
    C: Array
    K: Array
    back: Array
    weigh: Array
    spread: Array
    step: Array


class Observer:
    """The observers of one model on some stretches of measurements with known noise.

    ``rough``: the states (T, n) of each stretch as measured, the rest carried by the model; ``scale`` (n,): their RMS;
    ``reach`` (n,): how far the first of them may be from the truth; ``trackers``: one for each stretch; ``step``: the
    median time between samples in s.
    """

    def __init__(
        self, model: Model, stretches: Sequence[Segment], channels: tuple[str, ...], noise: Sequence[Noise]
    ) -> None:
        self.model, self.stretches, self.channels, self.noise = model, list(stretches), channels, list(noise)
        models = [model.under(s.conditions) for s in self.stretches]
        pairs = list(zip(models, self.stretches, strict=True))
        self.rough = [driven(one, s.t, s.u, measured_states(one, s, channels), s.early) for one, s in pairs]
        sizes = np.sqrt(np.mean(np.concatenate(self.rough) ** 2, axis=0))
        self.scale = np.where(sizes > 0, sizes, 1.0)
        self.trackers = [Tracker(one, s.t, s.u, s.y, channels, self.scale, s.early) for one, s in pairs]
        self.step = float(np.median(np.concatenate([np.diff(s.t) for s in self.stretches])))

    @cached_property
    def effective(self) -> Array:
        """Standard deviations (ny,) of white noise as strong at low frequencies as the noise of the channels."""
        return np.array([max(n.effective, 1e-12) for n in self.noise])

    @cached_property
    def reach(self) -> Array:
        """How far a measured state, or one that is not measured, may be from the truth (n,)."""
        noisy = {name: MAX_START_NOISE * n.effective for name, n in zip(self.channels, self.noise, strict=True)}
        free = MAX_START_RMS * self.scale
        return np.maximum([noisy.get(s, x) for s, x in zip(self.model.states, free, strict=True)], 1e-9 * self.scale)

    @cached_property
    def starts(self) -> list[Array]:
        """The state (n,) at the first sample of every stretch, from its first samples."""
        pairs = zip(self.trackers, self.rough, strict=True)
        return [fitted_start(tracker, x[0], self.reach, self.effective, MIN_START_SAMPLES) for tracker, x in pairs]

    @cached_property
    def _slopes(self) -> tuple[Array, Array, Array]:
        """Median dF/dx (n, n) and dh/dx (ny, n), and RMS of F (n,), over the stretches."""
        parts = [tracker.linearized(x) for tracker, x in zip(self.trackers, self.rough, strict=True)]
        every = max(1, sum(x.shape[0] for x in self.rough) // SLOPE_SAMPLES)
        rates, A, C = (np.concatenate(p)[::every] for p in zip(*parts, strict=True))
        return np.median(A, axis=0), np.median(C, axis=0), np.sqrt(np.mean(rates**2, axis=0))

    @cached_property
    def disturbed(self) -> list[int]:
        """Return the states of the plant whose equations may be wrong: all but a position that has its velocity."""
        plant, states = self.model.plant, self.model.states
        own = [i for i, name in enumerate(states) if "." not in name and name not in plant.own_state_names.values()]
        return [i for i in own if not (states[i] == plant.position and plant.velocity in states)]

    @cached_property
    def typical(self) -> Array:
        """Typical size of what the equation of each state holds (n,), in units of its rate."""
        A, _, rates = self._slopes
        return np.asarray(np.sqrt((A**2) @ self.scale**2 + rates**2))

    @cached_property
    def _discrete(self) -> tuple[Array, Array, dict[int, Array]]:
        """Transition and mean transition (n, n) over a step, and the noise in it (n, n) of a wholly wrong equation."""
        A, _, rates = self._slopes
        found = {}
        for i in self.disturbed:
            intensity = np.zeros(len(rates))
            intensity[i] = max(rates[i], 1e-12) ** 2 * MODEL_ERROR_PERSISTENCE
            transition, found[i], held = discrete(A, intensity, self.step)
        return transition, held, found

    def design(self, trust: float | Mapping[int, float]) -> ObserverDesign:
        """Design the observer of a model that is wrong by a share ``trust``, one for all or by index of the state."""
        C = self._slopes[1]
        shares = trust if isinstance(trust, Mapping) else dict.fromkeys(self.disturbed, trust)
        A, held, spectra = self._discrete
        Q = np.sum([shares[i] ** 2 * spectra[i] for i in self.disturbed], axis=0)
        R = np.diag(self.effective**2)
        P = predicted_covariance(A, C, Q, R)
        S = C @ P @ C.T + R
        K = np.linalg.solve(S, C @ P).T
        back = (A @ (np.eye(len(A)) - K @ C)).T
        step = np.asarray(held * self.step)
        spread = np.asarray(np.linalg.solve(step, Q))
        return ObserverDesign(A, C, K, back, np.linalg.solve(S, C).T, spread, step)

    def runs(self, design: ObserverDesign) -> list[TrackedRun]:
        """Follow every stretch, from what its first samples tell of its start."""
        return [tracker.run(x0, design.K[None]) for tracker, x0 in zip(self.trackers, self.starts, strict=True)]

    def states(self, design: ObserverDesign) -> list[Array]:
        """Return the causal estimate (T, n) of the states of every stretch, each from the samples up to its own."""
        return [r.state + np.nan_to_num(r.innovation) @ design.K.T for r in self.runs(design)]

    @cached_property
    def best_states(self) -> list[Array]:
        """The states (T, n) of every stretch from the observer whose one-step predictions are best."""
        found = []
        for trust in OBSERVER_TRUSTS:
            design = self.design(trust)
            errors = np.concatenate([run.innovation for run in self.runs(design)])
            found.append((float(np.sum(np.log(mean_square(errors) + 1e-300))), trust, design))
        return self.states(min(found, key=lambda item: item[:2])[2])


__all__ = ["OBSERVER_TRUSTS", "Observer", "ObserverDesign"]
