"""Every law of the catalogue by itself, with the signs and powers of its parameters turned as it allows.

Laws that `effects.LISTED` has are as large as there; those that are only in here have sizes of their own. Left out are
`learned_force`, which is no law, and `temperature_dependent_friction`, which asks for an input that a model must have.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from benchmarks.hidden.drives import CHANNELS, MASS, MOTOR, spread
from benchmarks.hidden.effects import LISTED, Setting, Values, applies


class Entry(NamedTuple):
    """A law on a plant, and the variant of it, empty where there is but one."""

    plant: str
    law: str
    variant: str = ""


def _cubic_viscous(s: Setting) -> Values:
    b = 1.3 * s.force() / s.scale.speed
    return {"b": b, "b3": b * s.rng.uniform(0.15, 0.4) / s.scale.speed**2}


def _less_than_viscous(s: Setting) -> Values:
    """Return friction that grows ever more slowly: the law holds below sqrt(b / |b3|), which is beyond the speeds."""
    b = 2.0 * s.force() / s.scale.speed
    return {"b": b, "b3": -b * s.rng.uniform(0.5, 0.9) / (2.5 * s.scale.speed) ** 2}


def _load_stribeck(s: Setting) -> Values:
    external = s.drive.spring > 0
    return {
        "kappa_d": 0.8 * s.share(),
        "kappa_e": 0.4 * s.share() if external else 0.0,
        "excess": s.rng.uniform(0.6, 1.5),
        "v_s": s.scale.speed * s.rng.uniform(0.1, 0.4),
    }


def _ripple(s: Setting) -> Values:
    """Return two waves, the second of two or three times the order of the first."""
    N = s.order(1.0, 3.0)
    second = float(s.rng.choice([2.0, 3.0])) * N
    A = 1.2 * s.force()
    second = second if second < 2 * np.pi / s.dt / 4 / s.scale.speed else float("nan")
    later = {"A_2": A * s.rng.uniform(0.4, 0.8), "N_2": second, "phi_2": s.phase()}
    return {"A": A, "N": N, "phi": s.phase(), **later}


def _play(s: Setting) -> Values:
    F_c, half = 1.2 * s.force(), 0.5 * s.scale.stroke
    return {"F_c": F_c, "sigma": F_c / (half * spread(s.rng, 0.03, 0.3)), "gap": half * spread(s.rng, 0.05, 0.3)}


def _pinching(s: Setting) -> Values:
    F_c = 1.2 * s.force()
    way = 0.5 * s.scale.stroke * spread(s.rng, 0.06, 0.5)
    return {"F_c": F_c, "sigma": F_c / way, "zeta": s.rng.uniform(0.6, 0.9), "z_p": way * s.rng.uniform(0.2, 0.5)}


def _maxwell(s: Setting) -> Values:
    """Return a force that relaxes within a fifth of what the motion lasts in one direction, to five times as long."""
    tau = s.scale.position / s.scale.speed * spread(s.rng, 0.2, 5.0)
    return {"k": 1.3 * s.force() / min(s.scale.position, s.scale.speed * tau), "tau": max(tau, 5.0 * s.dt)}


def _weak_cubic(s: Setting) -> Values:
    """Return a spring that softens, as far as the plant's own still holds."""
    k = s.drive.spring
    size = s.force() / s.scale.position**3
    return {"k3": -min(size, 0.6 * k / s.scale.reach**2) if k > 0 else float("nan")}


def _asymmetric(sign: float) -> Callable[[Setting], Values]:
    """Return how a spring is drawn that is stiffer one way: its cubic part as large as the quadratic, or smaller."""

    def drawn(s: Setting) -> Values:
        k2 = 1.3 * s.force() / s.scale.position**2
        return {"k2": sign * k2, "k3": k2 * s.rng.uniform(0.3, 1.0) / s.scale.position}

    return drawn


def _loop(n: float, low: float, high: float) -> Callable[[Setting], Values]:
    """Return how a loop of power n is drawn, its gamma between shares of beta."""

    def drawn(s: Setting) -> Values:
        values = LISTED["bouc_wen_hysteresis"](s)
        share = s.rng.uniform(low, high)
        total = s.rng.uniform(0.8, 1.1) if high > 0 else s.rng.uniform(0.4, 0.8)
        beta = total / (1.0 + max(share, 0.0))
        return {**values, "n": n, "beta": beta, "gamma": share * beta}

    return drawn


def _signed(law: str, name: str, sign: float) -> Callable[[Setting], Values]:
    """Return how a law is drawn with one of its parameters of a sign."""

    def drawn(s: Setting) -> Values:
        values = LISTED[law](s)
        return {**values, name: sign * abs(values[name])}

    return drawn


def _ordered(first: str, second: str) -> Callable[[Setting], Values]:
    """Return how friction of two directions is drawn, the first parameter the larger one."""

    def drawn(s: Setting) -> Values:
        small, large = sorted(LISTED["asymmetric_viscous_friction"](s).values())
        return {first: large, second: small}

    return drawn


def _on(law: str, channel: int, sign: float = 1.0) -> Callable[[Setting], Values]:
    """Return how a sensor's error is drawn on a channel."""

    def drawn(s: Setting) -> Values:
        name = CHANNELS[s.drive.plant][channel % len(CHANNELS[s.drive.plant])]
        if law == "sensor_offset":
            size = s.scale.current if name == "current" else s.scale.speed
            return {name: sign * s.share() * size}
        if law == "sensor_gain":
            return {name: 1.0 + sign * s.rng.uniform(0.1, 0.25)}
        return {name: s.rng.uniform(2.0, 6.0) * max(s.dt, 0.005)}

    return drawn


def _upside_down(s: Setting) -> Values:
    return {"A": -LISTED["gravity_load"](s)["A"], "q0": 0.0}


VARIANTS: dict[str, dict[str, Callable[[Setting], Values]]] = {
    "asymmetric_viscous_friction": {"forward": _ordered("b_p", "b_n"), "backward": _ordered("b_n", "b_p")},
    "cubic_viscous_friction": {"more": _cubic_viscous, "less": _less_than_viscous},
    "load_dependent_stribeck": {"": _load_stribeck},
    "constant_load": {"up": _signed("constant_load", "F0", 1.0), "down": _signed("constant_load", "F0", -1.0)},
    "gravity_load": {"hanging": LISTED["gravity_load"], "upright": _upside_down},
    "torque_ripple": {"": _ripple},
    "cubic_stiffness": {"hardens": LISTED["cubic_stiffness"], "softens": _weak_cubic},
    "play_friction": {"": _play},
    "pinching_hysteresis": {"": _pinching},
    "maxwell_element": {"": _maxwell},
    "bouc_wen_hysteresis": {
        f"{shape}, n {n:g}": _loop(n, low, high)
        for n in (1.0, 2.0)
        for shape, (low, high) in {"softens": (0.2, 0.9), "hardens": (-0.8, -0.2), "runs off": (-1.5, -1.1)}.items()
    },
    "sensor_offset": {"up": _on("sensor_offset", 1, 1.0), "down": _on("sensor_offset", 1, -1.0)},
    "sensor_gain": {"more": _on("sensor_gain", 1, 1.0), "less": _on("sensor_gain", 1, -1.0)},
    "sensor_delay": {"position": _on("sensor_delay", 2), "velocity": _on("sensor_delay", 1)},
    "asymmetric_stiffness": {"stiffer forward": _asymmetric(1.0), "stiffer backward": _asymmetric(-1.0)},
}
"""Laws of several forms, and those that no other group holds."""


def entries() -> list[Entry]:
    """Return every law with every variant on every plant that can have it."""
    laws = dict.fromkeys((*LISTED, *VARIANTS))
    found = [Entry(p, law, v) for law in laws for v in VARIANTS.get(law, {"": None}) for p in (MASS, MOTOR)]
    found = [e for e in found if applies(e.law, e.plant)]
    return [e for e in found if not (e.plant == MOTOR and e.variant == "softens")]  # it would run off its spring


def sizes(entry: Entry) -> Callable[[Setting], Values]:
    """Return how the values of an entry are drawn."""
    return VARIANTS.get(entry.law, {}).get(entry.variant) or LISTED[entry.law]


__all__ = ["VARIANTS", "Entry", "entries", "sizes"]
