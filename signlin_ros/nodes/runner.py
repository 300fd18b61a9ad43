"""Start a node, spin it, and end cleanly on SIGINT and SIGTERM."""

from __future__ import annotations

import faulthandler
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from signlin_ros.errors import InputError
from signlin_ros.nodes.security import check_security
from signlin_ros.nodes.start import FOLLOWED

RCLError = rclpy_implementation.RCLError
"""What rclpy raises for a parameter file that is not there or cannot be read, and for a bad command line."""


END_PATIENCE = 10.0
"""Seconds that taking a node down may last."""
INTERRUPT_TIME = 0.01
"""Time in s after which something is interrupted that could not be at once."""


class _Stop(BaseException):
    """Ends what is long in coming; nothing takes it for an exit that it has asked for itself, or for an error."""


_stopped: list[_Stop] = []
"""What has interrupted a node in the making: kept, so that what it left half made is not taken down piece by piece
after the context that it needs."""


def run(name: str, create: Callable[[], Node], arguments: Sequence[str] | None = None) -> int:
    """Run the node that ``create`` makes until a signal, or until it has ``finished``; return the exit code.

    One node, one executor, one process: what one node does never keeps another one waiting.

    0: ended as asked; 2: what the user gave is bad, said in one line. With the handlers of rclpy itself one
    end in ten fails on SIGTERM: the context dies under the running wait. So the signals only set a flag; what is
    long in coming, as the first compilation or a large record, they interrupt: at once, or a moment later where a
    callback from C would swallow it.
    """
    try:
        return _run(name, create, list(sys.argv if arguments is None else arguments))
    except _Stop as stop:
        _stopped.append(stop)
        return 0


def _run(name: str, create: Callable[[], Node], arguments: list[str]) -> int:
    signals, executor, node = _Signals(), None, None
    followed = int(os.environ.get(FOLLOWED, "0"))
    try:
        check_security(os.environ)
        rclpy.init(
            args=arguments,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        executor = SingleThreadedExecutor()
        node = create()
        signals.started = True
        executor.add_node(node)
        while not signals.stop and not getattr(node, "finished", False) and followed in (0, os.getppid()):
            executor.spin_once(timeout_sec=0.1)
            _rest(node)
        return 0
    except (InputError, RCLError, ParameterException) as error:
        get_logger(name).fatal(" ".join(str(error).split()))
        return 2
    finally:
        _end(executor, node)


def _rest(node: Node) -> None:
    """Let messages gather where a node has taken all that there were: one waking for several costs much less."""
    pause, node.rest = getattr(node, "rest", 0.0), 0.0
    if pause:
        time.sleep(pause)


class _Signals:
    """SIGINT and SIGTERM: ``stop`` is set by the first; until ``started`` is, it interrupts what is done.

    No `threading.Event`: a second signal may come while the first is handled, and would wait for its lock for ever.
    """

    def __init__(self) -> None:
        self.stop = self.started = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._stop)
        signal.signal(signal.SIGALRM, self._interrupt)
        sys.unraisablehook = self._swallowed

    def _stop(self, *_: Any) -> None:
        first, self.stop = not self.stop, True
        if first:
            self._interrupt()

    def _interrupt(self, *_: Any) -> None:
        if not self.started:
            raise _Stop

    def _swallowed(self, what: Any) -> None:
        """Interrupt once more what swallowed it; say what else is swallowed, but of what the interruption left so.

        An object whose ``__init__`` was interrupted may complain when it is taken down, as those of llvmlite do.
        """
        if what.exc_type is _Stop:
            signal.setitimer(signal.ITIMER_REAL, INTERRUPT_TIME)
        elif self.started or not self.stop:
            sys.__unraisablehook__(what)


def _end(executor: SingleThreadedExecutor | None, node: Node | None) -> None:
    """Take everything down; a second signal must not interrupt this. If it hangs, say where, and end all the same."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
        signal.signal(number, signal.SIG_IGN)
    faulthandler.dump_traceback_later(END_PATIENCE, exit=True, file=2)
    if executor is not None:
        executor.shutdown()
    if node is not None:
        node.destroy_node()
    rclpy.try_shutdown()
    faulthandler.cancel_dump_traceback_later()
