"""Messages that wait in a subscription, taken together: waking up is what costs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile


class Gathering:
    """A subscription that takes what waits in it with one waking, and then lets more gather for ``rest`` s.

    ``take(message, came)``: came in ns of the node's clock. The executor's loop must heed the node's ``rest``.
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        topic: str,
        take: Callable[[Any, int], None],
        qos: QoSProfile,
        rest: Callable[[], float],
    ) -> None:
        self._node, self._take, self._rest = node, take, rest
        self._simulated = bool(node.get_parameter("use_sim_time").value)
        self.subscription = node.create_subscription(kind, topic, self._on_message, qos)

    def _on_message(self, message: Any, info: Any) -> None:
        self._take(message, self._came(info))
        self.pump()
        self._node.rest = self._rest()

    def pump(self) -> None:
        """Take what waits now."""
        for message, info in _waiting(self.subscription):
            self._take(message, self._came(info))

    def _came(self, info: Any) -> int:
        now = int(self._node.get_clock().now().nanoseconds)
        return now if self._simulated else int(info["received_timestamp"]) or now

    def destroy(self) -> None:
        """Listen no more."""
        self._node.destroy_subscription(self.subscription)


def _waiting(subscription: Any) -> Iterator[tuple[Any, Any]]:
    """Yield the messages that wait in a subscription, with what the middleware says of them."""
    with subscription.handle:
        while (found := subscription.handle.take_message(subscription.msg_type, False)) is not None:
            yield found


__all__ = ["Gathering"]
