"""Which of the channels that come tell anything, without ROS: what is ignored by an option, and what is dead."""

from __future__ import annotations

from collections.abc import Mapping

from signlin_ros.errors import InputError, choices, suggest
from signlin_ros.model import Model

LEAST_MOTION = 20
"""Values of a position or a velocity that differ from the one before, by which a machine has moved: a channel that was
0 throughout is dead then."""
FIELDS = ("position", "velocity", "effort")
"""What a JointState calls its channels."""


class Channels:
    """Takes what sensors show, by the names of a model, and returns what is to be used of it.

    A channel is dead while it has been exactly 0 throughout although the machine has moved: a driver fills in a field
    that it does not measure. A position is never dead; a velocity is where the position moves. ``ignored``: names, of
    the model or of JointState, apart by commas; raises `InputError` for what is neither.
    """

    def __init__(self, model: Model, ignored: str = "") -> None:
        plant = model.plant
        own = dict(zip(FIELDS, (plant.position, plant.velocity, plant.effort), strict=True))
        if "current" in model.states:
            own["effort"] = "current"
        known = (*model.states, *model.inputs, *(FIELDS if plant.position else ()))
        asked = [name.strip() for name in ignored.split(",") if name.strip()]
        for name in asked:
            if name not in known:
                raise InputError(f"ignore: {name!r} is no channel; there are: {choices(known)}{suggest(name, known)}")
        self.ignored = frozenset(own.get(name, name) for name in asked)
        self._position, self._velocity = plant.position, plant.velocity
        self._alive: set[str] = {plant.position}
        self._last: dict[str, float] = {}
        self._moves = {plant.position: 0, plant.velocity: 0}
        self.dead: tuple[str, ...] = ()

    def told(self, shown: Mapping[str, float]) -> dict[str, float]:
        """Return what is to be used of what sensors show."""
        if not self._alive.issuperset(shown):
            self._look(shown)
        return {name: value for name, value in shown.items() if name not in self.ignored and name not in self.dead}

    def _look(self, shown: Mapping[str, float]) -> None:
        for name in self._moves:
            if name in shown:
                self._moves[name] += shown[name] != self._last.get(name, shown[name])
                self._last[name] = shown[name]
        self._alive |= {name for name, value in shown.items() if value != 0.0}
        turns, speeds = self._moves[self._position], self._moves[self._velocity]
        moved = {name: turns if name == self._velocity else turns + speeds for name in shown}
        silent = (name for name in shown if name not in self._alive and moved[name] >= LEAST_MOTION)
        self.dead = tuple(sorted({*silent, *self.dead} - self._alive))

    @property
    def sentence(self) -> str:
        """What is left out, and why; empty where nothing is."""
        dead = f"{' and '.join(self.dead)} 0 throughout, left out: nobody measures it" if self.dead else ""
        asked = f"{', '.join(sorted(self.ignored))} left out, as asked" if self.ignored else ""
        return "; ".join(part for part in (dead, asked) if part)


__all__ = ["Channels"]
