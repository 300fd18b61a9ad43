"""The running system on the page: a subscriber process whose lines are passed on to every page that looks."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

ROS_MISSING = 'ROS 2 is not installed here: pip install "signlin_ros[ros]", or source the setup file of your ROS 2.'
LONGEST_LINE = 4 << 20
MAX_PENDING_LINES = 100
"""Lines that a slow page may be behind; older ones are lost to it."""


class Live:
    """The subscriber, started with the first page that looks and ended after the last.

    ``options``: what the subscriber is told of the names (``--namespace /arm``).
    """

    def __init__(self, options: Sequence[str] = ()) -> None:
        self.options = tuple(options)
        self.listeners: set[asyncio.Queue[str]] = set()
        self._ended = False
        self._process: asyncio.subprocess.Process | None = None
        self._reading: asyncio.Task[None] | None = None
        self._answers: asyncio.Queue[dict[str, Any]] = asyncio.Queue()

    @property
    def why_not(self) -> str:
        """Why there is nothing live here; empty where there may be."""
        return "" if find_spec("rclpy") is not None else ROS_MISSING

    async def join(self) -> asyncio.Queue[str]:
        """Return where lines arrive for one page."""
        lines: asyncio.Queue[str] = asyncio.Queue(MAX_PENDING_LINES)
        self.listeners.add(lines)
        if self._ended:  # it came while the server ends
            lines.put_nowait("")
        elif self.why_not:
            lines.put_nowait(json.dumps({"why": self.why_not}))
        elif self._process is None or self._process.returncode is not None:
            await self._start()
        return lines

    async def leave(self, lines: asyncio.Queue[str]) -> None:
        """Take a page out; the subscriber ends with the last one."""
        self.listeners.discard(lines)
        if not self.listeners:
            await self.close()

    async def _start(self) -> None:
        self._process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "signlin_ros.nodes.feed", *self.options),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            start_new_session=True,
            limit=LONGEST_LINE,
        )
        self._reading = asyncio.get_running_loop().create_task(self._read(self._process))

    async def _read(self, process: asyncio.subprocess.Process) -> None:
        if process.stdout is None:
            return
        while line := await process.stdout.readline():
            text = line.decode().rstrip()
            if text.startswith('{"taken"'):
                self._answers.put_nowait(json.loads(text))
            else:
                self._pass_on(text)
        self._pass_on(json.dumps({"why": "the subscriber has ended; see the terminal of signlin workbench"}))

    def _pass_on(self, text: str) -> None:
        for lines in self.listeners:
            if lines.full():
                lines.get_nowait()
            lines.put_nowait(text)

    def end(self) -> None:
        """End the streams of all pages, and of those that still come."""
        self._ended = True
        self._pass_on("")

    async def take(self, seconds: float, file: str, states: list[str], inputs: list[str]) -> dict[str, Any]:
        """Let the subscriber write the last seconds as a record; return what it says."""
        if self._process is None or self._process.stdin is None or self._process.returncode is not None:
            return {"taken": None, "why": "nothing is live"}
        asked = {"take": seconds, "file": file, "names": states, "inputs": inputs}
        self._process.stdin.write((json.dumps(asked) + "\n").encode())
        await self._process.stdin.drain()
        return await asyncio.wait_for(self._answers.get(), 30.0)

    async def close(self) -> None:
        """End the subscriber."""
        process, self._process = self._process, None
        if process is None or process.returncode is not None:
            return
        if process.stdin is not None:
            process.stdin.close()
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(process.wait(), 3.0)
        if process.returncode is None:
            process.kill()


__all__ = ["Live"]
