"""When a message counts as sent: a busy computer delivers late, and clocks may not agree."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")

from signlin_ros.nodes.gather import CLOCK_MESSAGES, MAX_MESSAGE_AGE, Gathering, pump_in_turn
from signlin_ros.observe.watch import Pace

NOW = 10**18


class Node:
    """A node's clock and parameter, and nothing that comes by itself."""

    def get_parameter(self, _: str) -> Any:
        return SimpleNamespace(value=False)

    def create_subscription(self, *_: Any) -> Any:
        return SimpleNamespace()

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=NOW))


def times(*lags: int) -> list[int]:
    """What the last of messages that were so long on the way count as, relative to when they came."""
    gathering = Gathering(Node(), object, "input", lambda *_: None, 10, lambda: 0.0, sent=True)
    return [gathering._came({"received_timestamp": NOW, "source_timestamp": NOW - lag}) - NOW for lag in lags]


def test_a_message_that_is_held_up_counts_from_when_it_was_sent() -> None:
    assert times(1000, MAX_MESSAGE_AGE + 40_000_000, 2 * MAX_MESSAGE_AGE, 3000) == [
        -1000,
        -MAX_MESSAGE_AGE - 40_000_000,
        -2 * MAX_MESSAGE_AGE,
        -3000,
    ]


def test_clocks_that_do_not_agree_are_not_compared() -> None:
    assert times(2 * MAX_MESSAGE_AGE, 3 * MAX_MESSAGE_AGE, -1000) == [0, 0, 0]


def test_clocks_that_agree_no_more_are_not_compared_any_longer() -> None:
    found = times(1000, *[2 * MAX_MESSAGE_AGE] * CLOCK_MESSAGES)
    assert found[1] == -2 * MAX_MESSAGE_AGE
    assert found[-1] == 0


class Waiting(Gathering):
    """A subscription in which messages wait, each with the time at which it came."""

    def __init__(self, take: Any, *came: int) -> None:
        self._take, self.came = take, came

    def waiting(self) -> list[Any]:
        return [(came, self._take, None) for came in self.came]


def test_what_waited_long_is_taken_in_the_order_in_which_it_came() -> None:
    """States for 0.1 s before the first of their inputs looked as if inputs had stayed away: nothing was judged."""
    pace, missed = Pace(), []
    states = Waiting(lambda _, came: missed.append(pace.missed(came / 1e9)), *range(0, 1_000_000_000, 5_000_000))
    inputs = Waiting(lambda _, came: pace.take(came / 1e9), *range(0, 1_000_000_000, 15_000_000))
    pump_in_turn(states, inputs)
    assert len(missed) == 200
    assert not any(missed)
