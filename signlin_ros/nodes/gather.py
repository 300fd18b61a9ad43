"""Messages that wait in a subscription, taken together: waking up is what costs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile

MAX_MESSAGE_AGE = 500_000_000
"""Nanoseconds on the way within which some message comes where the clocks of the two sides agree."""
CLOCK_MESSAGES = 1000
"""Messages, one after the other, that must all come later for clocks that have agreed to agree no more."""


class Unheeded(CallbackGroup):  # type: ignore[misc]
    """A group whose subscriptions no executor waits for."""

    def can_execute(self, entity: Any) -> bool:
        """Return that it cannot be executed."""
        return False

    def beginning_execution(self, entity: Any) -> bool:
        """Return that it is not."""
        return False

    def ending_execution(self, entity: Any) -> None:
        """Nothing has begun."""


class Gathering:
    """A subscription that takes what waits in it with one waking, and then lets more gather for ``rest`` s.

    ``take(message, came)``: when it came in ns of the node's clock; with ``sent``, when it was sent, where both clocks
    agree: a busy machine delivers late. The executor's loop must heed the node's ``rest``. Without ``waking`` nothing
    is taken but by `pump`: for who looks for the newest at times of his own.
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        topic: str,
        take: Callable[[Any, int], None],
        qos: QoSProfile,
        rest: Callable[[], float],
        sent: bool = False,
        waking: bool = True,
    ) -> None:
        self._node, self._take, self._rest, self._sent = node, take, rest, sent
        self._slow = CLOCK_MESSAGES
        self._simulated = bool(node.get_parameter("use_sim_time").value)
        group = {} if waking else {"callback_group": Unheeded()}
        self.subscription = node.create_subscription(kind, topic, self._on_message, qos, **group)

    def _on_message(self, message: Any, info: Any) -> None:
        self._take(message, self._came(info))
        self.pump()
        self._node.rest = self._rest()

    def pump(self) -> None:
        """Take what waits now."""
        for message, info in _waiting(self.subscription):
            self._take(message, self._came(info))

    def waiting(self) -> list[tuple[int, Callable[[Any, int], None], Any]]:
        """Return what waits now, taken out: when it came in ns, what takes it, and the message."""
        return [(self._came(info), self._take, message) for message, info in _waiting(self.subscription)]

    def _came(self, info: Any) -> int:
        now = int(self._node.get_clock().now().nanoseconds)
        if self._simulated:
            return now
        came, sent = int(info["received_timestamp"]) or now, int(info["source_timestamp"])
        self._slow = 0 if 0 <= came - sent < MAX_MESSAGE_AGE else self._slow + 1
        return sent if self._sent and came >= sent and self._slow < CLOCK_MESSAGES else came

    def destroy(self) -> None:
        """Listen no more."""
        self._node.destroy_subscription(self.subscription)


def pump_in_turn(*gatherings: Gathering) -> None:
    """Take what waits in several subscriptions, in the order in which it came.

    Give states first and inputs last: an input that comes meanwhile is then not missed by a state that came later.
    """
    found = [one for gathering in gatherings for one in gathering.waiting()]
    for came, take, message in sorted(found, key=lambda one: one[0]):
        take(message, came)


def _waiting(subscription: Any) -> Iterator[tuple[Any, Any]]:
    """Yield the messages that wait in a subscription, with what the middleware says of them."""
    with subscription.handle:
        while (found := subscription.handle.take_message(subscription.msg_type, False)) is not None:
            yield found


__all__ = ["Gathering", "Unheeded", "pump_in_turn"]
