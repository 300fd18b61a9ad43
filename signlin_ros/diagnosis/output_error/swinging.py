"""Whether a load swings because the axis moves it, or by itself.

A load behind a coupling that is hardly damped swings on from where it was at the beginning of a record, as a vibration
from outside does: at its frequency the two look alike. The axis moves the one and not the other. What a load that is
at rest beside the axis at first would do is linear in the motion:

    r'' = q'' - (c r' + k r) / J,  r = q - q2, r = r' = 0 at the beginning
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

from signlin_ros.diagnosis.blocks import MIN_DIVISOR
from signlin_ros.effects import EFFECTS
from signlin_ros.fitting.fit import Fit
from signlin_ros.fitting.following import follow_records
from signlin_ros.fitting.problem import Problem
from signlin_ros.model.uses import EffectUse

Array = NDArray[np.float64]


def undriven_shares(problem: Problem, f: Fit) -> dict[str, float]:
    """Return which share of the squared stretch of each resonant load's coupling is not what the measured motion makes
    of one that was at rest beside the axis at the beginning of each record, by the keys of the effects; a slow observer
    follows the axis. Empty where no load swings, or the motion is lost.
    """
    model, place = f.candidate.model, problem.base.plant.position
    uses = {key: use for key, use in model.effects.items() if EFFECTS[use.type].resonant and key in f.candidate.label}
    if not uses or place not in model.states:
        return {}
    run = follow_records(problem, f.candidate.started_for(f.gains.tau), f.theta, f.gains, False)
    if run is None:
        return {}
    fitted, found = f.fitted().effects, dict[str, float]()
    for key in uses:
        left, whole = 0.0, 0.0
        for s, X in zip(problem.segments, run[2], strict=True):
            q, own = (X[:, model.states.index(name)] for name in (place, f"{key}.position"))
            t = np.linspace(s.t[0], s.t[-1], s.t.size)
            q, stretch = np.interp(t, s.t, q), np.interp(t, s.t, q - own)
            left += float(np.sum((stretch - _driven(fitted[key], t, q)) ** 2))
            whole += float(np.sum(stretch**2))
        found[key] = left / max(whole, MIN_DIVISOR)
    return found


def _driven(use: EffectUse, t: Array, q: Array) -> Array:
    """Return the stretch (T,) of the coupling of a load that moves with the axis, at q (T,), at the beginning."""
    k, c, J = (use.parameters[name] for name in ("k", "c", "J"))
    step = float(t[1] - t[0])
    moved = q - q[0] - (q[1] - q[0]) / step * (t - t[0])
    numerator, denominator, _ = cont2discrete(([J, 0.0, 0.0], [J, c, k]), step, method="bilinear")
    return np.asarray(lfilter(np.ravel(numerator), denominator, moved))


__all__ = ["undriven_shares"]
