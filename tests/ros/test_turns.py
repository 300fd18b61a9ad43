"""Turns of a loop from a thread of their own, or from a timer where time is simulated."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")

from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402

from signlin_ros.nodes.turns import Turns  # noqa: E402


@pytest.fixture
def node_of() -> Iterator[Callable[..., Any]]:
    rclpy.init()
    made = []

    def make(simulated: bool = False) -> Any:
        node = rclpy.create_node("turns", parameter_overrides=[Parameter("use_sim_time", value=simulated)])
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        made.append((node, executor))
        return node, executor

    yield make
    for node, executor in made:
        executor.shutdown()
        node.destroy_node()
    rclpy.try_shutdown()


def spin_until(executor: Any, condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end
        executor.spin_once(timeout_sec=0.1)


def test_turns_come_from_one_thread_while_the_executor_is_busy(node_of):
    node, executor = node_of()
    threads: list[int] = []
    turns = Turns(node, 0.002, lambda: threads.append(threading.get_ident()))
    time.sleep(0.01)
    assert not threads  # not before the executor runs: whoever is interrupted while it is made has nothing to end
    spin_until(executor, lambda: len(threads) > 3)
    while len(threads) < 20:  # nobody spins
        time.sleep(0.01)
    turns.stop()
    count = len(threads)
    assert set(threads) != {threading.get_ident()}
    assert len(set(threads)) == 1
    time.sleep(0.02)
    assert len(threads) == count


def test_a_turn_waits_for_the_lock(node_of):
    node, executor = node_of()
    done: list[int] = []
    turns = Turns(node, 0.002, lambda: done.append(1))
    spin_until(executor, lambda: len(done) > 1)
    with turns.lock:
        count = len(done)
        time.sleep(0.03)
        assert len(done) == count
    spin_until(executor, lambda: len(done) > count)
    turns.stop()


def test_an_error_in_a_turn_ends_the_executor(node_of):
    node, executor = node_of()

    def fail() -> None:
        raise ValueError("the run diverges")

    turns = Turns(node, 0.002, fail)
    with pytest.raises(ValueError, match="the run diverges"):
        spin_until(executor, lambda: False)
    turns.stop()


def test_with_simulated_time_the_executor_gives_the_turns(node_of):
    node, _ = node_of(simulated=True)
    turns = Turns(node, 0.002, lambda: None)
    assert not turns.in_thread
    turns.restart()
    turns.stop()
