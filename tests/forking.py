"""Executables that do not import everything anew: copies of a process that has imported what they need.

A node takes two seconds of processor time to import CasADi, Numba and SciPy and to load compiled code, a server of the
page and the template of its workers take as much. `Zygote` starts one Python process, `main` below, which does that
once and then, for each executable, makes a copy of itself [fork(2)] that runs the same file with the same arguments and
environment.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

_spent = 0.0


def spent_by_copies() -> float:
    """Return the processor time in s of copies that have ended: they are no children of this process."""
    return _spent


class Copied:
    """A copy that runs an executable, with what the tests use of `subprocess.Popen`."""

    def __init__(self, zygote: Zygote, command: list[str], pid: int) -> None:
        self.args, self.pid, self.returncode, self._zygote = command, pid, None, zygote  # type: ignore[var-annotated]

    def poll(self) -> int | None:
        if self.returncode is None:
            self._zygote.listen(0.0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        end = None if timeout is None else time.monotonic() + timeout
        while self.returncode is None:
            left = None if end is None else end - time.monotonic()
            if left is not None and left <= 0.0:
                raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
            self._zygote.listen(left)
        return self.returncode

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


class Zygote:
    """The process that is copied, seen from the tests.

    ``imported``: modules that copies need. A library that starts threads when it is imported cannot be among them.
    """

    def __init__(self, *imported: str) -> None:
        ours, theirs = socket.socketpair()
        command = [sys.executable, __file__, str(theirs.fileno()), *imported]
        env = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}  # whose threads a copy would not have
        self._process = subprocess.Popen(command, pass_fds=[theirs.fileno()], env=env)
        theirs.close()
        self._socket, self._copies, self._spent = ours, dict[int, Copied](), 0.0

    def start(self, command: list[str], log: Path, env: dict[str, str], folder: Path | None = None) -> Copied:
        """Run a Python file with arguments in a folder, or here; what it prints is added to a file."""
        log.touch()  # it is there to be read before the copy has begun
        order = {"command": command, "log": str(log), "env": env, "folder": str(folder or Path.cwd())}
        self._socket.sendall(json.dumps(order).encode() + b"\n")
        while (answer := self._read())["kind"] != "begun":
            self._note(answer)
        return self._copies.setdefault(answer["pid"], Copied(self, command, answer["pid"]))

    def listen(self, timeout: float | None) -> None:
        """Take notice of copies that have ended; of one at least where there is no ``timeout``."""
        while select.select([self._socket], [], [], timeout)[0]:
            self._note(self._read())
            timeout = 0.0

    def _read(self) -> dict[str, Any]:
        line = b""
        while not line.endswith(b"\n"):
            piece = self._socket.recv(1)
            if not piece:
                raise RuntimeError(f"the process that is copied ended with {self._process.wait()}")
            line += piece
        return dict(json.loads(line))

    def _note(self, answer: dict[str, Any]) -> None:
        global _spent  # noqa: PLW0603
        self._copies.pop(answer["pid"]).returncode = answer["code"]
        _spent += answer["spent"]
        self._spent += answer["spent"]

    def close(self) -> None:
        """End the process, and copies that are left."""
        for one in list(self._copies.values()):
            one.kill()
        self._socket.close()
        self._process.wait()
        global _spent  # noqa: PLW0603
        _spent -= self._spent  # from now on this process has it in its own account, with those it has waited for


# -------------------------------------------------------------------- in the process that is copied


@contextmanager
def when_asked(imported: Sequence[str]) -> Iterator[Callable[[], Zygote]]:
    """Yield what makes a zygote when it is first asked for, and returns that one ever after; close it in the end."""
    made: list[Zygote] = []

    def only() -> Zygote:
        if not made:
            made.append(Zygote(*imported))
        return made[0]

    yield only
    for one in made:
        one.close()


def main() -> None:
    """Import everything, then start copies as long as the tests ask for them."""
    orders = socket.socket(fileno=int(sys.argv[1]))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of a terminal: it is the tests' to end this
    for name in sys.argv[2:]:
        importlib.import_module(name)
    from signlin_ros.model import Model
    from signlin_ros.warming import warm_up

    warm_up(Model.load("dc_motor"))  # which loads compiled code
    threads = len(list(Path("/proc/self/task").iterdir()))
    assert threads == 1, f"a process of {threads} threads must not be copied"
    gc.collect()
    gc.freeze()
    woken, wake = os.pipe()
    for end in (woken, wake):
        os.set_blocking(end, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
    unread, copies = b"", set[int]()
    while True:
        ready = select.select([orders, woken], [], [])[0]
        if woken in ready:
            os.read(woken, 4096)
            copies -= _tell_ended(orders)
        if orders not in ready:
            continue
        received = orders.recv(1 << 16)
        if not received:  # the tests have ended, in order or not: nothing is left running
            for pid in copies:
                os.kill(pid, signal.SIGKILL)
            return
        *whole, unread = (unread + received).split(b"\n")
        for line in whole:
            order = json.loads(line)
            pid = os.fork()
            if pid == 0:
                signal.set_wakeup_fd(-1)
                for one in (orders.detach(), woken, wake):
                    os.close(one)
                _run(**order)
            copies.add(pid)
            orders.sendall(json.dumps({"kind": "begun", "pid": pid}).encode() + b"\n")


def _tell_ended(orders: socket.socket) -> set[int]:
    """Tell of copies that have ended: the code as `subprocess` has it, and seconds of processor time; return them."""
    ended = set[int]()
    while True:
        try:
            pid, status, used = os.wait4(-1, os.WNOHANG)
        except ChildProcessError:
            return ended
        if pid == 0:
            return ended
        ended.add(pid)
        code, spent = os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime
        orders.sendall(json.dumps({"kind": "ended", "pid": pid, "code": code, "spent": spent}).encode() + b"\n")


def _run(command: list[str], log: str, env: dict[str, str], folder: str) -> None:
    """Become an executable: what Python runs from here on is its file, and nothing after it."""
    for number, what in ((signal.SIGCHLD, signal.SIG_DFL), (signal.SIGINT, signal.default_int_handler)):
        signal.signal(number, what)
    with Path(log).open("ab") as out:
        for stream in (1, 2):
            os.dup2(out.fileno(), stream)
    with Path(os.devnull).open("rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(env)
    sys.argv = command
    runpy.run_path(command[0], run_name="__main__")
    sys.exit(0)


if __name__ == "__main__":
    main()
