"""The template of worker processes seen from the event loop: it has imported what they need, and they are its copies.

A worker of its own takes a second to import the numerics before its first answer, a copy some milliseconds; and copies
share the memory of what was imported.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import socket
import sys
from typing import Any

WORKER = "signlin_ros.workbench.worker"


def environment() -> dict[str, str]:
    """Return the environment of workers: their own modules, nothing held back that they print."""
    return {**os.environ, "PYTHONUNBUFFERED": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


class WorkerCopy:
    """A worker that is a copy of the template, with what a lane uses of `asyncio.subprocess.Process`."""

    def __init__(self, pid: int, stdout: asyncio.StreamReader, stdin: asyncio.StreamWriter) -> None:
        self.pid, self.stdout, self.stdin = pid, stdout, stdin
        self.returncode: int | None = None
        self._over = asyncio.Event()

    def kill(self) -> None:
        """End it at once; raises `ProcessLookupError` where it has ended."""
        if self.returncode is not None:
            raise ProcessLookupError
        os.kill(self.pid, signal.SIGKILL)

    def ended(self, code: int) -> None:
        """Take notice of its end."""
        self.returncode = code
        self.stdin.close()
        self._over.set()

    async def wait(self) -> int | None:
        """Return its exit code when it has ended."""
        await self._over.wait()
        return self.returncode


class WorkerTemplate:
    """The process whose copies are workers; started when first needed, and anew where it has ended."""

    def __init__(self) -> None:
        self._process: asyncio.subprocess.Process | None = None
        self._orders: socket.socket | None = None
        self._begun: asyncio.Queue[int | None] = asyncio.Queue()
        self._copies: dict[int, WorkerCopy] = {}
        self._ended_at_once: dict[int, int] = {}
        self._turn = asyncio.Lock()
        self._listening: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Start the process if there is none."""
        if self._listening is not None and not self._listening.done():
            return
        if self._orders is not None:
            self._orders.close()
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", WORKER, "template", str(theirs.fileno())),
                stdin=asyncio.subprocess.DEVNULL,
                stdout=asyncio.subprocess.PIPE,
                pass_fds=[theirs.fileno()],
                env={"OPENBLAS_NUM_THREADS": "1", **environment()},  # a process of several threads is not to be copied
                start_new_session=True,
            )
        self._orders, self._begun = ours, asyncio.Queue()
        self._listening = asyncio.create_task(self._listen(self._process, self._begun))

    async def worker(self, nice: int) -> WorkerCopy:
        """Return a new worker; raises `ConnectionError` where the template ends whenever it is asked."""
        making = asyncio.ensure_future(self._made(nice))
        try:
            return await asyncio.shield(making)  # an order that was sent has an answer, which the next must not take
        except asyncio.CancelledError:
            making.add_done_callback(_not_wanted)
            raise

    async def _made(self, nice: int) -> WorkerCopy:
        async with self._turn:
            try:
                return await self._copied(nice)
            except ConnectionError:  # it has ended since the last one
                if self._listening is not None:
                    await self._listening
                return await self._copied(nice)

    async def _copied(self, nice: int) -> WorkerCopy:
        await self.start()
        ours, theirs = socket.socketpair()
        try:
            with theirs:
                socket.send_fds(self._given(), [str(nice).encode()], [theirs.fileno()])
            pid = await self._begun.get()
            if pid is None:
                raise ConnectionError("the template of workers has ended")
        except ConnectionError:
            ours.close()
            raise
        ours.setblocking(False)
        copy = WorkerCopy(pid, *await asyncio.open_connection(sock=ours))
        if pid in self._ended_at_once:
            copy.ended(self._ended_at_once.pop(pid))
        else:
            self._copies[pid] = copy
        return copy

    def _given(self) -> socket.socket:
        if self._orders is None:
            raise ConnectionError("the template of workers has not begun")
        return self._orders

    async def _listen(self, process: asyncio.subprocess.Process, begun: asyncio.Queue[int | None]) -> None:
        """Take notice of what the template tells; when it has ended, all its copies end."""
        while process.stdout is not None and (line := await process.stdout.readline()):
            told: dict[str, Any] = json.loads(line)
            if "begun" in told:
                begun.put_nowait(told["begun"])
            elif (copy := self._copies.pop(told["ended"], None)) is not None:
                copy.ended(told["code"])
            else:  # before `worker` has it
                self._ended_at_once[told["ended"]] = told["code"]
        begun.put_nowait(None)
        for copy in self._copies.values():
            with contextlib.suppress(ProcessLookupError):
                copy.kill()
            copy.ended(-signal.SIGKILL)
        self._copies.clear()

    async def close(self) -> None:
        """End the process and its copies."""
        if self._process is None or self._orders is None or self._listening is None:
            return
        self._orders.close()
        await self._listening
        await self._process.wait()


def _not_wanted(made: asyncio.Future[WorkerCopy]) -> None:
    """End a worker that nobody waits for any more."""
    with contextlib.suppress(asyncio.CancelledError, ConnectionError, ProcessLookupError):
        made.result().kill()


__all__ = ["WorkerCopy", "WorkerTemplate", "environment"]
