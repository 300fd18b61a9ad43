"""A worker process: requests come in on standard input, answers and progress go out on what was standard output.

Every message is a frame: the lengths of a head and of a body (two unsigned 32-bit numbers), the head as JSON, the body
as bytes that the server passes on unread. Whatever a library prints goes to standard error.

The same program is the template of workers (`signlin_ros.workbench.template`): it imports what the verbs need, once,
and is copied for each of them [fork(2)]. Orders come with a socket, on which the copy answers; which process was begun
or has ended goes out in lines of JSON.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import resource
import select
import signal
import socket
import struct
import sys
import threading
import traceback
import warnings
from collections.abc import Callable
from typing import Any, BinaryIO

from signlin_ros.errors import InputError, MissingExtraError, one_line

FRAME = struct.Struct(">II")
MAX_WORKER_MEMORY = 12 << 30
"""Address space in bytes that a worker may take: what unpacks without end stops here."""

IDLE = 0.5
"""Seconds without an order after which the template loads compiled code."""


def write(stream: BinaryIO, head: dict[str, Any], body: bytes = b"") -> None:
    """Write one frame."""
    text = json.dumps(head).encode()
    stream.write(FRAME.pack(len(text), len(body)) + text + body)
    stream.flush()


def read(stream: BinaryIO) -> dict[str, Any] | None:
    """Return the head of the next frame, None at the end."""
    lengths = stream.read(FRAME.size)
    if len(lengths) < FRAME.size:
        return None
    head, body = FRAME.unpack(lengths)
    found = json.loads(stream.read(head))
    stream.read(body)
    return dict(found)


def answer(request: dict[str, Any], say: Callable[[dict[str, Any]], None]) -> tuple[dict[str, Any], bytes]:
    """Run what is asked for; return the head and the body of the answer."""
    from signlin_ros.workbench.calls import WORKER_CALLS, CodeError

    try:
        result = WORKER_CALLS[request["verb"]](request["args"], say)
        return {"kind": "result"}, json.dumps(result).encode()
    except CodeError as error:
        return {"kind": "refused", "what": one_line(error), "files": error.files}, b""
    except (InputError, MissingExtraError) as error:
        return {"kind": "refused", "what": one_line(error)}, b""
    except MemoryError:
        return {"kind": "refused", "what": "this needs more memory than a worker may take"}, b""
    except Exception as error:  # noqa: BLE001 - the page must say what failed, whatever it was
        traceback.print_exc()
        return {"kind": "fault", "what": f"{type(error).__name__}: {one_line(error)}"}, b""


def _own_output() -> BinaryIO:
    """Return what was standard output; from now on `print` goes to standard error."""
    outgoing = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return outgoing


def _own_streams() -> tuple[BinaryIO, BinaryIO]:
    """Return the streams of frames to read and to write."""
    incoming, outgoing = os.fdopen(os.dup(0), "rb"), _own_output()
    with open(os.devnull, "rb") as nothing:  # noqa: PTH123 - a descriptor is wanted
        os.dup2(nothing.fileno(), 0)
    return incoming, outgoing


def _requests(incoming: BinaryIO) -> queue.SimpleQueue[dict[str, Any]]:
    """Return where requests arrive; when the server is gone, the process ends, whatever it is doing."""
    arriving: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()

    def listen() -> None:
        while (request := read(incoming)) is not None:
            arriving.put(request)
        os._exit(0)

    threading.Thread(target=listen, daemon=True).start()
    return arriving


def _writer(outgoing: BinaryIO) -> Callable[..., None]:
    """Return a function that writes frames one after the other, from any thread."""
    turn = threading.Lock()

    def put(head: dict[str, Any], body: bytes = b"") -> None:
        with turn:
            write(outgoing, head, body)

    return put


def serve(incoming: BinaryIO, outgoing: BinaryIO, nice: int) -> None:
    """Answer until the server closes the stream or dies, giving way to other processes by so much."""
    os.nice(nice)
    put = _writer(outgoing)
    resource.setrlimit(resource.RLIMIT_AS, (MAX_WORKER_MEMORY, resource.RLIM_INFINITY))
    warnings.simplefilter("ignore")
    arriving = _requests(incoming)
    while True:
        request = arriving.get()
        number = request["id"]
        head, body = answer(request, lambda told: put({"id": number, "kind": "progress", **told}))  # noqa: B023
        put({"id": number, **head}, body)


# -------------------------------------------------------------------- the template


def copy_on_order(orders: socket.socket, told: BinaryIO) -> None:
    """Import what the verbs need; then start a copy of this process as a worker for each order, until the server ends.

    While nothing is ordered, compiled code is loaded for the copies to come.
    """
    from signlin_ros.workbench.calls import load_compiled, ready

    ready({}, lambda _: None)
    warnings.simplefilter("ignore")
    woken, wake = os.pipe()
    for end in (woken, wake):
        os.set_blocking(end, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
    watched: list[Any] = [orders, woken]
    idle: float | None = IDLE
    while True:
        found = select.select(watched, [], [], idle)[0]
        if not found:
            load_compiled()
            idle = None
        if woken in found:
            os.read(woken, 4096)
            _tell_ended(told)
        if orders in found:
            order, descriptors, *_ = socket.recv_fds(orders, 4096, 1)
            if not order:
                return
            pid = os.fork()
            if pid == 0:
                signal.set_wakeup_fd(-1)
                signal.signal(signal.SIGCHLD, signal.SIG_DFL)
                for one in (orders.fileno(), told.fileno(), woken, wake):
                    os.close(one)
                _be_worker(descriptors[0], int(order))
            os.close(descriptors[0])
            _tell(told, begun=pid)


def _tell(told: BinaryIO, **what: int) -> None:
    told.write(json.dumps(what).encode() + b"\n")
    told.flush()


def _tell_ended(told: BinaryIO) -> None:
    with contextlib.suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            _tell(told, ended=ended[0], code=os.waitstatus_to_exitcode(ended[1]))


def _be_worker(descriptor: int, nice: int) -> None:
    """Serve on a socket in a session of its own; never returns."""
    try:
        os.setsid()
        serve(os.fdopen(descriptor, "rb"), os.fdopen(os.dup(descriptor), "wb"), nice)
    except BaseException:  # noqa: BLE001 - nothing of the template may go on in a copy
        traceback.print_exc()
    finally:
        os._exit(1)


def main() -> None:
    """Be a worker that gives way by the argument, or the template of workers where that is ``template DESCRIPTOR``."""
    if sys.argv[1] == "template":
        copy_on_order(socket.socket(fileno=int(sys.argv[2])), _own_output())
    else:
        serve(*_own_streams(), int(sys.argv[1]))


if __name__ == "__main__":
    main()
