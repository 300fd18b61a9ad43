"""``signlin`` as a copy of a process that has imported everything (`tests.forking`) runs it: what it starts as the
template of its workers is a copy too, made before anything runs here that could not be copied.

The template gets what the server gives to it when it starts it, and a session of its own; one that is started after
that has ended imports everything itself.
"""

from __future__ import annotations

import asyncio
import json
import os
import socket
import sys
from pathlib import Path
from typing import Any, NoReturn

from signlin_ros.cli.running import main
from signlin_ros.workbench import worker
from signlin_ros.workbench.template import WORKER


class Begun:
    """The template, with what the server uses of `asyncio.subprocess.Process`."""

    def __init__(self, pid: int, stdout: asyncio.StreamReader) -> None:
        self.pid, self.stdout = pid, stdout
        self._over = asyncio.get_running_loop().run_in_executor(None, os.waitpid, pid, 0)

    async def wait(self) -> int:
        return os.waitstatus_to_exitcode((await self._over)[1])


def be_template(orders: socket.socket) -> NoReturn:
    """Wait until the server starts it, or ends; then be what the server's command would be."""
    environment, descriptors, *_ = socket.recv_fds(orders, 1 << 20, 2)
    if not environment:
        os._exit(0)
    given, output = descriptors
    os.setsid()
    os.environ.clear()
    os.environ.update(json.loads(environment))
    os.dup2(output, 1)
    for descriptor in (orders.detach(), output):
        os.close(descriptor)
    sys.argv = [WORKER, "template", str(given)]
    code = 1
    try:
        worker.main()
        code = 0
    finally:
        os._exit(code)


def template_at_hand() -> None:
    """Make the copy that waits, and let the server have it in place of a process of the same command."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    pid = os.fork()
    if pid == 0:
        ours.close()
        be_template(theirs)
    theirs.close()
    waiting, otherwise = [ours], asyncio.create_subprocess_exec

    async def started(*command: str, **options: Any) -> Any:
        if command[1:4] != ("-m", WORKER, "template") or not waiting:
            return await otherwise(*command, **options)
        reading, writing = os.pipe()
        with waiting.pop() as orders:
            socket.send_fds(orders, [json.dumps(options["env"]).encode()], [*options["pass_fds"], writing])
        os.close(writing)
        stdout, printed = asyncio.StreamReader(), os.fdopen(reading, "rb")
        await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(stdout), printed)
        return Begun(pid, stdout)

    asyncio.create_subprocess_exec = started  # type: ignore[assignment]


if __name__ == "__main__":
    template_at_hand()
    sys.path[0] = str(Path.cwd())  # as `python -m` has it
    sys.exit(main())
