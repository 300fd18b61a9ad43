"""Machine code for tapes: every operation against NumPy, the cache on disk, threads and processes."""

import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError

from signlin_ros.engine.compiling import call, call_within, caller
from signlin_ros.engine.native import _Cache, _engine, native
from signlin_ros.engine.operations import NUMPY as OPERATIONS
from signlin_ros.engine.tape import Tape

RANDOM = np.random.default_rng(7)
UNIT, POSITIVE, ABOVE_ONE = (-1.0, 1.0), (0.0, 5.0), (1.0, 5.0)
DOMAINS = {
    ca.OP_LOG: POSITIVE,
    ca.OP_POW: POSITIVE,
    ca.OP_CONSTPOW: POSITIVE,
    ca.OP_SQRT: POSITIVE,
    ca.OP_ASIN: UNIT,
    ca.OP_ACOS: UNIT,
    ca.OP_ATANH: UNIT,
    ca.OP_LOG1P: UNIT,
    ca.OP_ACOSH: ABOVE_ONE,
}
CORNERS = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (2.0, 2.0), (-1.0, -1.0), (-2.0, 3.0), (0.5, -0.0)]
SPECIAL = [(np.nan, 1.0), (1.0, np.nan), (np.nan, np.nan), (np.inf, 1.0), (-np.inf, 1.0), (1.0, np.inf)]
IN_A_PROCESS = """
import sys
import numpy as np
from signlin_ros.engine.compiling import caller
from signlin_ros.engine.native import native
from signlin_ros.engine.tape import Tape
import casadi as ca
x = ca.SX.sym("x")
print("ready", flush=True)
sys.stdin.readline()
for k in range(20):
    out = np.zeros(1)
    caller(native(Tape.of(ca.Function("f", [x], [ca.sin(x) * (k + 1)])))[0])(np.array([0.5]), out)
    assert out[0] == np.sin(0.5) * (k + 1), (k, out)
"""
BEGUN = """
from signlin_ros.engine.compiling import compiled
from signlin_ros.engine.parts import prepared, put

@compiled
def begun(at, x):
    w = prepared(at, x)
    put(at, w, x)
    return w
"""
PLANS_IN_A_PROCESS = """
import sys
import numpy as np
from begun import begun
from signlin_ros.engine.exact import exact_plan
from signlin_ros.engine.smooth import smooth_plan
plans = {"exact": exact_plan((0, 0), 2, 1, 0, 1, 1, 0), "smooth": smooth_plan((0, 0), 2, 1, 0, 0)}
for kind in sys.argv[1:]:
    at = plans[kind]
    w = begun(at, np.array([3.0, 4.0]))
    print(kind, w.size == at["size"], w[at["x"] : at["x"] + 2].tolist(), w[at["peak"] : at["peak"] + 2].tolist())
"""
"""What begins a run of either kind, without the integrator, which takes seconds to compile."""


def single(op: int) -> Tape:
    """One operation of two inputs."""
    none = np.zeros(0)
    return Tape(np.array([op]), np.array([0]), np.array([1]), none, np.array([2]), n_in=2, n_head=1)


def values(tape: Tape, *inputs: float) -> np.ndarray:
    out = np.zeros(tape.n_out)
    caller(native(tape)[0])(np.array(inputs, dtype=float), out)
    return out


def test_more_functions_than_an_engine_takes_are_all_there(monkeypatch):
    monkeypatch.setattr("signlin_ros.engine.native.MOST_MODULES", 3)
    x, before = ca.SX.sym("x"), _engine.cache_info().currsize
    tapes = [Tape.of(ca.Function("f", [x], [ca.sin(x) * (k + 0.75)])) for k in range(8)]
    for _ in range(2):
        assert [values(tape, 0.5)[0] for tape in tapes] == [np.sin(0.5) * (k + 0.75) for k in range(8)]
    assert _engine.cache_info().currsize >= before + 2


def process(cache: Path, *, run: bool = True) -> subprocess.Popen[str]:
    env = {n: v for n, v in os.environ.items() if n != "NUMBA_CACHE_DIR"} | {"XDG_CACHE_HOME": str(cache)}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    started = subprocess.Popen([sys.executable, "-c", IN_A_PROCESS], env=env, text=True, **pipes)
    if run:
        finished(started)
    return started


def finished(started: subprocess.Popen[str]) -> None:
    _, errors = started.communicate("\n", timeout=300)
    assert started.returncode == 0, errors


def code_files(cache: Path) -> list[Path]:
    return sorted((cache / "signlin_ros" / "native").iterdir())


@pytest.mark.parametrize("op", OPERATIONS)
def test_operation_is_numpys(op):
    low, high = DOMAINS.get(op, (-3.0, 3.0))
    points = [*RANDOM.uniform(low, high, (300, 2)).tolist(), *CORNERS, *SPECIAL]
    found = [values(single(op), *point)[0] for point in points]
    wanted = single(op).batch([np.array(column) for column in zip(*points, strict=True)])[0]
    np.testing.assert_allclose(found, wanted, rtol=1e-15, atol=0)


def test_unknown_operation_is_refused():
    with pytest.raises(NotImplementedError, match="CasADi operation"):
        native(single(ca.OP_ERF))


def test_head_computes_only_the_first_outputs():
    x = ca.SX.sym("x", 2)
    tape = Tape.of(ca.Function("f", [x], [ca.vertcat(x[0] + x[1], 3.0, ca.exp(x[0]), x[1])]), 2)
    whole, head = native(tape)
    out, first = np.full(4, 9.0), np.full(4, 9.0)
    caller(whole)(np.array([1.0, 2.0]), out)
    caller(head)(np.array([1.0, 2.0]), first)
    np.testing.assert_allclose(out, [3.0, 3.0, np.e, 2.0], rtol=1e-15)
    np.testing.assert_array_equal(first, [3.0, 3.0, 9.0, 9.0])
    assert native(tape) == (whole, head)


@pytest.mark.parametrize("value", [0.1, -0.0, 5e-324, 1e308, np.inf, -np.inf, np.nan])
def test_constants_are_exact(value):
    none = np.zeros(0, dtype=np.int64)
    tape = Tape(none, none, none, np.array([value]), np.array([1]), n_in=1, n_head=1)
    np.testing.assert_array_equal(values(tape, 2.0).view(np.int64), np.array([value]).view(np.int64))


def test_call_within_one_array():
    @njit
    def run(address, work):
        call_within(address, work, 2, 5)

    work = np.arange(8.0)
    run(native(single(ca.OP_SUB))[0], work)
    np.testing.assert_array_equal(work, [0.0, 1.0, 2.0, 3.0, 4.0, -1.0, 6.0, 7.0])


@pytest.mark.parametrize("wrong", [np.zeros(2, dtype=np.float32), np.zeros(2, dtype=int), np.zeros(4)[::2]])
def test_other_arrays_are_refused(wrong):
    @njit
    def run(address, inputs, results):
        call(address, inputs, results)

    with pytest.raises(TypingError, match="contiguous arrays of float64"):
        run(native(single(ca.OP_ADD))[0], wrong, np.zeros(1))


def test_threads_share_what_is_compiled():
    x, found, start = ca.SX.sym("x"), {}, threading.Barrier(6)
    tapes = [Tape.of(ca.Function("f", [x], [ca.cos(x) * (0.77 + k)])) for k in range(15)]

    def compile_all(number: int) -> None:
        start.wait()
        found[number] = [native(tape) for tape in tapes]

    threads = [threading.Thread(target=compile_all, args=(number,)) for number in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 6
    assert all(found[number] == found[0] for number in found)
    assert [values(tape, 0.2)[0] for tape in tapes] == [np.cos(0.2) * (0.77 + k) for k in range(15)]


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A folder that one process has filled."""
    folder = tmp_path_factory.mktemp("filled")
    process(folder)
    assert len(code_files(folder)) == 20
    return folder


@pytest.mark.slow
def test_cache_is_used_again(filled):
    files = code_files(filled)
    times = [file.stat().st_mtime_ns for file in files]
    process(filled)
    assert code_files(filled) == files
    assert [file.stat().st_mtime_ns for file in files] == times


@pytest.mark.slow
def test_damaged_cache_is_written_again(filled, tmp_path):
    shutil.copytree(filled, tmp_path, dirs_exist_ok=True)
    files = code_files(tmp_path)
    whole = [file.read_bytes() for file in files]
    for k, file in enumerate(files):
        file.write_bytes(whole[k][: k * 20] if k % 2 else b"\0" * len(whole[k]))
    process(tmp_path)
    assert [file.read_bytes() for file in files] == whole


@pytest.mark.slow
def test_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "signlin_ros").write_text("a file where the folder should be")
    process(tmp_path)
    assert (tmp_path / "signlin_ros").is_file()


@pytest.mark.slow
def test_processes_may_write_at_the_same_time(tmp_path):
    started = [process(tmp_path, run=False) for _ in range(2)]
    for one in started:
        assert one.stdout is not None
        assert one.stdout.readline() == "ready\n"
    for one in started:
        assert one.stdin is not None
        one.stdin.write("\n")
        one.stdin.flush()
    for one in started:
        finished(one)
    assert len(code_files(tmp_path)) == 20
    assert all(file.suffix == ".code" for file in code_files(tmp_path))


@pytest.mark.slow
def test_kernels_cached_by_different_processes_work_together(tmp_path):
    (tmp_path / "begun.py").write_text(BEGUN)
    places = os.pathsep.join([str(tmp_path), *sys.path])
    env = {**os.environ, "PYTHONPATH": places, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}

    def said(*kinds: str) -> list[str]:
        command = [sys.executable, "-c", PLANS_IN_A_PROCESS, *kinds]
        return subprocess.run(
            command, env=env, capture_output=True, text=True, check=True, timeout=300
        ).stdout.splitlines()

    right = {kind: f"{kind} True [3.0, 4.0] [3.0, 4.0]" for kind in ("exact", "smooth")}
    for kinds in (("exact",), ("smooth",), ("exact", "smooth"), ("smooth", "exact")):
        assert said(*kinds) == [right[kind] for kind in kinds]


class Module:
    def __init__(self, name: str) -> None:
        self.name = name


def test_the_oldest_code_is_removed_where_there_is_too_much(tmp_path):
    for i in range(8):
        _Cache(tmp_path).save(Module(f"old{i}"), b"code")
        os.utime(tmp_path / f"old{i}.code", (i, i))
    cache = _Cache(tmp_path, most=8)
    cache.save(Module("new"), b"code")
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == ["new.code", "old4.code", "old5.code", "old6.code", "old7.code"]
    for i in range(8):
        cache.save(Module(f"more{i}"), b"code")
    assert len(list(tmp_path.iterdir())) == 13  # once in a process
    assert cache.load(Module("new")) == b"code"
    assert cache.load(Module("old0")) is None


def test_a_part_that_changes_in_another_file_is_compiled_afresh(tmp_path):
    part = "from signlin_ros.engine.compiling import inner\n\n@inner\ndef part(x):\n    return x + {}.0\n"
    whole = "from signlin_ros.engine.compiling import compiled\nfrom part import part\n\n@compiled\n"
    (tmp_path / "whole.py").write_text(whole + "def whole(x):\n    return part(x)\n")
    said = "from whole import whole; print(whole(1.0), sum(whole.stats.cache_hits.values()))"
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path]), "NUMBA_CACHE_DIR": str(tmp_path)}
    for added, found in ((1, ["2.0", "0"]), (1, ["2.0", "1"]), (22, ["23.0", "0"])):
        (tmp_path / "part.py").write_text(part.format(added))
        command = [sys.executable, "-B", "-c", said]
        done = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
        assert done.stdout.split() == found
