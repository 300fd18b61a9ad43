"""What the monitor tells as single numbers with names, for PlotJuggler, Foxglove and the like: ``~/plot/...``.

Those plot a Float64 by the name of its topic; an entry of a flat array has none.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Float64

from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.nodes.monitor_logic import MonitorScore
from signlin_ros.nodes.qos import RELIABLE
from signlin_ros.nodes.told import Update

MOST_STATES = 6
"""States up to which poles and entries of A and B have topics: an arm would have hundreds."""

Array = NDArray[np.float64]


def topic(*parts: str) -> str:
    """Return the name of a topic: what ROS does not take in a name (as in ``elbow.position``) becomes ``_``."""
    return "/".join(re.sub(r"[^A-Za-z0-9_]", "_", part) for part in parts)


class Scalars:
    """What is told of one model, by the names of topics. ``bare``: its linearizer without dry friction."""

    def __init__(self, model: Model, bare: Linearizer) -> None:
        states, inputs = model.states, model.inputs
        small = len(states) <= MOST_STATES
        self._bare, self._kept = bare, [states.index(name) for name in bare.model.states]
        self._of_score = [
            [topic(kind, n) for n in states] for kind in ("error", "error_without_friction", "rms", "fit")
        ]
        self._friction = [topic("friction", name) for name in bare.model.states]
        self._A = [topic("A", row, column) for row in states for column in states] if small else []
        self._B = [topic("B", row, column) for row in states for column in inputs] if small else []
        poles = [f"pole_{k + 1}" for k in range(len(states))] if small else []
        self._poles = [topic(pole, part) for part in ("real", "imaginary") for pole in poles]

    @property
    def names(self) -> list[str]:
        """All topics."""
        return [*chain(*self._of_score), *self._friction, *self._A, *self._B, *self._poles]

    def of_score(self, score: MonitorScore) -> dict[str, float]:
        """Return the errors after one update period, their RMS, and the fit in percent."""
        return _named(zip(self._of_score, (score.error, score.bare, score.rms, score.fit), strict=True))

    def of_update(self, update: Update) -> dict[str, float]:
        """Return A, B, the poles in 1/s, the slowest first, and what dry friction adds to the rate of each state."""
        r = update.result
        found = _named([(self._friction, r.f[self._kept] - self._bare(r.x[self._kept], r.u).f)])
        if self._A:
            poles = np.linalg.eigvals(r.A)
            poles = poles[np.lexsort((poles.imag, -poles.real))]
            found |= _named([(self._A, r.A.ravel()), (self._B, r.B.ravel())])
            found |= _named([(self._poles, np.concatenate([poles.real, poles.imag]))])
        return found


def _named(groups: Iterable[tuple[list[str], Array]]) -> dict[str, float]:
    return {name: float(v) for names, values in groups for name, v in zip(names, values, strict=True)}


class ScalarTopics:
    """A publisher of Float64 for each scalar of the present model; what nobody listens to is not worked out."""

    def __init__(self, node: Any, wanted: bool = True) -> None:
        self._node, self._wanted = node, wanted
        self._scalars: Scalars | None = None
        self._publishers: dict[str, Any] = {}

    def take_model(self, model: Model, bare: Linearizer) -> None:
        """Have the topics of this model from now on. ``bare``: its linearizer without dry friction."""
        if self._wanted:
            self._scalars = Scalars(model, bare)
            self._declare(self._scalars.names)

    def close(self) -> None:
        """Have no topics any more."""
        self._scalars = None
        self._declare([])

    def tell_update(self, update: Update) -> None:
        """Publish what is listened to of a linear model."""
        if self._scalars is not None and (heard := self._heard()):
            self._publish(heard, self._scalars.of_update(update))

    def tell_score(self, score: MonitorScore) -> None:
        """Publish what is listened to of a score."""
        if self._scalars is not None and (heard := self._heard()):
            self._publish(heard, self._scalars.of_score(score))

    def _declare(self, names: list[str]) -> None:
        for name in [name for name in self._publishers if name not in names]:
            self._node.destroy_publisher(self._publishers.pop(name))
        for name in names:
            if name not in self._publishers:
                self._publishers[name] = self._node.create_publisher(Float64, f"~/plot/{name}", RELIABLE)

    def _heard(self) -> set[str]:
        return {name for name, publisher in self._publishers.items() if publisher.get_subscription_count()}

    def _publish(self, heard: set[str], values: dict[str, float]) -> None:
        for name in heard & values.keys():
            self._publishers[name].publish(Float64(data=values[name]))


__all__ = ["ScalarTopics", "Scalars", "topic"]
