"""The tests' own helper: what is kept, and what is told apart."""

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from signlin_ros.model import Model
from tests import once as module
from tests.once import FOLDER, digest, once

COUNTED = """
import sys
from pathlib import Path
from tests.once import once
def work(calls, number):
    with Path(calls).open("a") as file:
        file.write("x")
    return number + 1
assert once(work, sys.argv[1], 41) == 42
"""


@dataclass(frozen=True)
class Thing:
    values: np.ndarray
    name: str


def counted(calls, number):
    calls.append(number)
    return [number]


@pytest.fixture
def kept(tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER, str(tmp_path))
    monkeypatch.setattr(module, "_here", {})
    return tmp_path


def test_it_is_worked_out_once(kept, monkeypatch):
    class Calls(list):
        def __repr__(self):
            return "calls"

    calls = Calls()
    monkeypatch.setattr(module, "_parts", lambda value: [] if isinstance(value, Calls) else None)
    assert once(counted, calls, 1) == once(counted, calls, 1) == [1]
    assert once(counted, calls, 2) == [2]
    module._here.clear()  # as in another process
    assert once(counted, calls, 1) == [1]
    assert calls == [1, 2]


def test_processes_share_it(kept):
    root = Path(__file__).parents[2]
    env = {**os.environ, "PYTHONPATH": f"{root}:{os.environ.get('PYTHONPATH', '')}"}
    command = [sys.executable, "-c", COUNTED, str(kept / "calls")]
    started = [subprocess.Popen(command, cwd=root, env=env) for _ in range(3)]
    assert [one.wait(120) for one in started] == [0, 0, 0]
    assert (kept / "calls").read_text() == "x"


def test_what_fails_is_not_kept(kept):
    with pytest.raises(ZeroDivisionError):
        once(divmod_of, 1, 0)
    with pytest.raises(ZeroDivisionError):
        once(divmod_of, 1, 0)
    assert not [file for file in kept.iterdir() if file.suffix != ".lock"]


def divmod_of(a, b):
    return divmod(a, b)


def test_equal_things_have_one_digest_and_others_another():
    motor = Model.load("dc_motor")
    same = digest(motor, Thing(np.arange(3.0), "a"), {"k": (1, 2.0)})
    assert digest(Model.load("dc_motor"), Thing(np.arange(3.0), "a"), {"k": (1, 2.0)}) == same
    for other in (
        (motor.with_parameters(J=0.003), Thing(np.arange(3.0), "a"), {"k": (1, 2.0)}),
        (motor, Thing(np.arange(3.0) + 1e-16, "b"), {"k": (1, 2.0)}),
        (motor, Thing(np.array([0.0, 1.0, 2.0 + 1e-15]), "a"), {"k": (1, 2.0)}),
        (motor, Thing(np.arange(3.0), "a"), {"k": (1, 2)}),
        (motor, Thing(np.arange(3.0).astype(np.float32), "a"), {"k": (1, 2.0)}),
    ):
        assert digest(*other) != same
    assert digest([1, [2]]) != digest([[1], 2])
    assert digest(["1"]) != digest([1])


def test_what_has_no_value_to_tell_it_by_is_refused():
    with pytest.raises(TypeError, match="object has no digest"):
        digest(object())


def test_what_shares_a_file_stays_in_one_worker(request):
    """Groups are told by the names of tests: a pytest that xdist does not know yet hands out each by itself."""
    if not getattr(request.config.option, "loadgroup", False):
        pytest.skip("tests run in one process, or without groups")
    assert request.node.nodeid.rpartition("@")[2] in ("unit/test_once.py", "tests/unit/test_once.py")
