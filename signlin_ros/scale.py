"""How large things are in a record: where a fit starts from."""

from __future__ import annotations

from dataclasses import dataclass

from signlin_ros.par import POWER_DIGITS

MAX_STEP_OVER_TIME_CONSTANT = 3.0
"""Steps of so many time constants leave nothing of a motion (5 %)."""


@dataclass(frozen=True)
class Scale:
    """Sizes in SI units: RMS of driving force, velocity and acceleration, half the travel, RMS current (1 without),
    largest input, median sampling step and duration in s; inertia of the plant (0 where there is none).
    """

    force: float
    travel: float
    velocity: float
    acceleration: float
    current: float
    input: float
    step: float
    duration: float
    inertia: float = 0.0

    @property
    def imposed(self) -> bool:
        """Whether the motion is imposed: nothing inert stands between the input and what is measured."""
        return not self.inertia

    @property
    def excursion(self) -> float:
        """How far the motion goes between two reversals, about."""
        return min(self.travel, self.velocity**2 / self.acceleration)

    def of(self, unit: str) -> float:
        """Return the size of a declared unit, e.g. of ``F·s/Q``: force by velocity."""
        special = {"s": self.step, "rad": 1.0, "-": 1.0, "1/A²": self.current**-2, "1/Q": 1.0 / self.travel}
        if self.inertia:
            special["F·s²/Q"] = self.inertia
        if unit in special:
            return special[unit]
        if unit == "U":
            return self.input
        powers = {"F": 0, "Q": 0, "s": 0}
        for part, sign in zip(unit.split("/"), (1, -1), strict=False):
            for token in part.split("·"):
                base = token.rstrip(POWER_DIGITS)
                if base in powers:
                    powers[base] += sign * (1 if token == base else 2 + POWER_DIGITS.index(token[-1]))
        lengths, times = powers["Q"], abs(powers["s"])
        way = 1 if lengths > 0 else -1
        if times > abs(lengths):
            return float(self.force ** powers["F"] * self.acceleration**way)
        moving = self.velocity ** (way * times) * self.travel ** (lengths - way * times)
        return float(self.force ** powers["F"] * moving)


__all__ = ["Scale"]
