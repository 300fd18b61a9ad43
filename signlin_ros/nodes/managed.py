"""Managed nodes: configured, activated, deactivated and cleaned up by whoever asks, or by themselves at the start."""

from __future__ import annotations

from collections.abc import Mapping

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn

from signlin_ros.errors import InputError
from signlin_ros.nodes.overrides import Overridable
from signlin_ros.nodes.parameters import ModelNode

AUTOSTART = {
    "autostart": Overridable(True, "configure and activate at the start; false: wait to be asked (ros2 lifecycle)")
}


class ManagedNode(LifecycleNodeMixin, ModelNode):  # type: ignore[misc]
    """A `ModelNode` with the life cycle of ROS 2.

    A node says what it does in `set_up` (publishers, logic), `begin` (subscriptions, timers), `end` and `take_down`.
    `begin` and `end` may come many times. A transition that is not possible now is refused, and nothing changes: rclpy
    itself would end the executor (ros2/rclpy#1209).
    """

    def __init__(self, name: str, options: Mapping[str, Overridable], follows: bool = False) -> None:
        ModelNode.__init__(self, name, {**options, **AUTOSTART}, follows)
        LifecycleNodeMixin.__init__(self, enable_communication_interface=True, callback_group=None)
        self._fault: InputError | None = None

    def start(self) -> None:
        """Configure and activate, where ``autostart`` says so; raise `InputError` with what prevents it."""
        if not self.options["autostart"]:
            return
        for trigger in (self.trigger_configure, self.trigger_activate):
            if trigger() != TransitionCallbackReturn.SUCCESS:
                raise self._fault or InputError(f"{self.get_name()} cannot start")

    @property
    def active(self) -> bool:
        """Whether the node is at work."""
        return bool(self._state_machine.current_state[1] in ("active", "activating"))

    # ---------------------------------------------------------------- what a node does

    def set_up(self) -> None:
        """Make what is needed before anything runs."""

    def begin(self) -> None:
        """Start to work."""

    def end(self) -> None:
        """Stop to work; `begin` may follow."""

    def take_down(self) -> None:
        """Undo `set_up`."""

    # ---------------------------------------------------------------- transitions

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """See `set_up`."""
        try:
            self.set_up()
        except InputError as error:
            self._fault = error
            self.get_logger().error(f"cannot be configured: {error}")
            self.take_down()
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """See `begin`."""
        self.begin()
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """See `end`."""
        self.end()
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """See `take_down`."""
        self.take_down()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End what runs, and undo all."""
        if state.label == "active":
            self.end()
        if state.label in ("active", "inactive"):
            self.take_down()
        return TransitionCallbackReturn.SUCCESS

    def _LifecycleNodeMixin__change_state(self, transition: int) -> TransitionCallbackReturn:
        """Refuse what is not possible now, where the mixin's own method would raise through the executor."""
        try:
            return super()._LifecycleNodeMixin__change_state(transition)
        except rclpy_implementation.RCLError:
            self.get_logger().warning(f"transition {transition} is not possible from the present state: refused")
            return TransitionCallbackReturn.FAILURE
