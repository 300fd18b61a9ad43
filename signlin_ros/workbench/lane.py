"""A worker process seen from the event loop: one request at a time, progress on the way, killed at any moment."""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from signlin_ros.workbench.template import WORKER, WorkerCopy, WorkerTemplate, environment
from signlin_ros.workbench.worker import FRAME

Say = Callable[[dict[str, Any]], None]


class RefusedError(Exception):
    """What was given is bad; the text says what, and what is allowed. ``files``: code to be agreed to first, if any."""

    def __init__(self, what: str, files: Sequence[dict[str, str]] = ()) -> None:
        super().__init__(what)
        self.files = list(files)


class FaultError(Exception):
    """Something of ours failed."""


class LaneCancelledError(Exception):
    """The user has cancelled it."""


class Lane:
    """A worker process in ``folder``, started when first needed and anew after it was cancelled.

    ``nice``: by how much it gives way to others, as `nice` counts: what takes long must not slow what is looked at.
    ``template``: what it is a copy of, in the folder of that; without one it imports everything itself.
    """

    def __init__(self, folder: Path, nice: int = 0, template: WorkerTemplate | None = None) -> None:
        self._folder, self._nice, self._lock, self._number = folder, nice, asyncio.Lock(), 0
        self._template = template
        self._process: asyncio.subprocess.Process | WorkerCopy | None = None
        self._cancels = 0

    async def start(self) -> asyncio.subprocess.Process | WorkerCopy:
        """Start the process if there is none."""
        if self._process is None or self._process.returncode is not None:
            self._process = await (self._template.worker(self._nice) if self._template else self._started())
        return self._process

    async def _started(self) -> asyncio.subprocess.Process:
        return await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", WORKER, str(self._nice)),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            cwd=self._folder,
            env=environment(),
            start_new_session=True,
        )

    async def raw(self, verb: str, args: dict[str, Any], say: Say | None = None) -> bytes:
        """Return the JSON text of what a verb of `calls` answers.

        Raises `RefusedError`, `FaultError`, or `LaneCancelledError`.
        """
        cancels = self._cancels
        async with self._lock:
            try:
                process = await self.start()
            except ConnectionError as error:
                raise FaultError(str(error)) from error
            self._number += 1
            try:
                if self._cancels != cancels:  # before it was its turn, or before there was a process
                    raise LaneCancelledError
                return await self._exchange(process, {"id": self._number, "verb": verb, "args": args}, say)
            except (asyncio.IncompleteReadError, ConnectionError) as error:
                await process.wait()
                if self._cancels != cancels:
                    raise LaneCancelledError from error
                raise FaultError(f"the worker process ended with code {process.returncode}") from error

    async def call(self, verb: str, args: dict[str, Any], say: Say | None = None) -> Any:
        """Return the answer of a verb as JSON; raises as `raw`."""
        return json.loads(await self.raw(verb, args, say))

    async def _exchange(
        self, process: asyncio.subprocess.Process | WorkerCopy, request: dict[str, Any], say: Say | None
    ) -> bytes:
        if process.stdin is None or process.stdout is None:
            raise FaultError("the worker has no pipes")
        text = json.dumps(request).encode()
        process.stdin.write(FRAME.pack(len(text), 0) + text)
        await process.stdin.drain()
        while True:
            head_size, body_size = FRAME.unpack(await process.stdout.readexactly(FRAME.size))
            head = json.loads(await process.stdout.readexactly(head_size))
            body = await process.stdout.readexactly(body_size)
            if head.get("id") != request["id"]:
                continue
            if head["kind"] == "progress":
                if say is not None:
                    say(head)
            elif head["kind"] == "result":
                return body
            elif head["kind"] == "refused":
                raise RefusedError(head["what"], head.get("files", ()))
            else:
                raise FaultError(head["what"])

    async def rest(self) -> None:
        """End the process once it does nothing; the next request starts another one."""
        async with self._lock:
            await self._killed()

    async def cancel(self) -> None:
        """Kill the process, whatever it does, and refuse what waits for it; the next request starts another one."""
        self._cancels += 1
        await self._killed()

    async def _killed(self) -> None:
        if self._process is not None and self._process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                self._process.kill()
            await self._process.wait()


__all__ = ["FaultError", "Lane", "LaneCancelledError", "RefusedError"]
