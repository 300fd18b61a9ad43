"""Where a node's states come from: the options that say so, and what is alike for all who read joint_states."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from signlin_ros.nodes import convert
from signlin_ros.nodes.channels import Channels
from signlin_ros.nodes.joint import effort_input
from signlin_ros.nodes.overrides import Overridable

STATE_OPTIONS = {
    "state_source": Overridable("array", "where states come from", choices=("array", "joint_state")),
    "joint_name": Overridable("joint", "name of the joint in joint_states"),
    "stamps": Overridable(
        "header",
        "when joint_states are of: their header's stamp, or reception, where a driver leaves it empty",
        choices=("header", "reception"),
    ),
    "ignore": Overridable(
        "", "channels that are left out, apart by commas: names of the model, or position, velocity, effort"
    ),
}


class StateReader:
    """What nodes with `STATE_OPTIONS` have in common; stands beside a `ModelNode`."""

    options: dict[str, Any]
    model: Any
    _has_input = _has_effort = False

    @property
    def hardware_id(self) -> str:
        """What diagnostics are of: one id for each joint, with its namespace; the plant where states are an array."""
        joint = self.options["state_source"] == "joint_state" and self.model.plant.name != "arm"
        name = self.options["joint_name"] if joint else self.model.plant.name
        return f"{self.get_namespace()}/{name}".strip("/")  # type: ignore[attr-defined]

    def stamp_of(self, message: Any, now: int) -> int:
        """Return the time in ns that a message of joint_states is of; ``now``: when it came."""
        return now if self.options["stamps"] == "reception" else convert.nanoseconds(message.header.stamp)

    def effort_as_input(self, joint: Mapping[str, float], channels: Channels) -> float | None:
        """Return the effort of a joint where it serves as the input; None where it does not.

        It does where the model's input is the effort and nobody publishes one on a topic, from the first effort on that
        is not 0: one that is 0 throughout is not measured.
        """
        effort = effort_input(self.model, joint)
        self._has_effort = self._has_effort or bool(effort)
        spoken = self._has_input or self.model.plant.effort in channels.ignored
        return effort if self._has_effort and not spoken else None

    def warn_once(self, what: str, sentence: str) -> None:
        """Log a warning the first time that there is one of this kind: diagnostics go on telling."""
        told: set[str] = self.__dict__.setdefault("_told_once", set())
        if what not in told:
            told.add(what)
            self.get_logger().warning(sentence)  # type: ignore[attr-defined]


__all__ = ["STATE_OPTIONS", "StateReader"]
