"""Turns of a loop at a fixed period, from a thread of their own."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable

from rclpy.node import Node


class Turns:
    """Calls ``turn`` every ``period`` s; one that is missed is not made up for.

    From a thread: an executor's waking costs several times what a turn does (0.3 ms against 0.1 ms of a processor), and
    keeps what is due waiting behind other callbacks. ``lock`` is held in every turn: callbacks of the node that touch
    what a turn does take it, too. With simulated time the turns come from a timer in the node's executor.

    An error in a turn is raised in the executor. The turns begin once that runs; `stop` waits for the last one.
    """

    def __init__(self, node: Node, period: float, turn: Callable[[], None]) -> None:
        self._period, self._turn = period, turn
        self.lock = threading.RLock()
        self._ended, self._error = threading.Event(), None  # type: threading.Event, BaseException | None
        self._thread: threading.Thread | None = None
        self.in_thread = not node.get_parameter("use_sim_time").value
        if self.in_thread:
            self._guard = node.create_guard_condition(self._on_guard)
            self._guard.trigger()
        else:
            self._timer = node.create_timer(period, turn)

    def restart(self) -> None:
        """Let a period pass before the next turn: the clock has jumped."""
        if not self.in_thread:
            self._timer.reset()

    def stop(self) -> None:
        """End the turns."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join()

    def _on_guard(self) -> None:
        if self._error is not None:
            raise self._error
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, daemon=True)
            self._thread.start()

    def _run(self) -> None:
        due = time.monotonic() + self._period
        while not self._ended.wait(max(due - time.monotonic(), 0.0)):
            try:
                with self.lock:
                    self._turn()
            except Exception as error:  # noqa: BLE001 - it is raised again, where the node ends
                self._error = error
                self._guard.trigger()
                return
            due += self._period * max(math.ceil((time.monotonic() - due) / self._period), 1)


__all__ = ["Turns"]
