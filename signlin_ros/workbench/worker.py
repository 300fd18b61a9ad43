"""A worker process: requests come in on standard input, answers and progress go out on what was standard output.

Every message is a frame: the lengths of a head and of a body (two unsigned 32-bit numbers), the head as JSON, the body
as bytes that the server passes on unread. Whatever a library prints goes to standard error.
"""

from __future__ import annotations

import json
import os
import queue
import resource
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


def _own_streams() -> tuple[BinaryIO, BinaryIO]:
    """Return the streams of frames to read and to write; from now on `print` goes to standard error."""
    incoming, outgoing = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
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


def main() -> None:
    """Answer until the server closes the pipe or dies; the argument says by how much to give way to other processes."""
    os.nice(int(sys.argv[1]))
    incoming, outgoing = _own_streams()
    put = _writer(outgoing)
    resource.setrlimit(resource.RLIMIT_AS, (MAX_WORKER_MEMORY, resource.RLIM_INFINITY))
    warnings.simplefilter("ignore")
    arriving = _requests(incoming)
    while True:
        request = arriving.get()
        number = request["id"]
        head, body = answer(request, lambda told: put({"id": number, "kind": "progress", **told}))  # noqa: B023
        put({"id": number, **head}, body)


if __name__ == "__main__":
    main()
