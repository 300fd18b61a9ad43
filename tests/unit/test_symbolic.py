"""Expressions are written by one thread at a time: those of CasADi share constants, which another may forget."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import pytest

from signlin_ros.comparison.equations import force_equations
from signlin_ros.compiled import exact_tape, linear_tape, smooth_tape
from signlin_ros.follow.equations import equations
from signlin_ros.model import Model

PARAMETERS = {"m": 1.0, "c": 0.5, "k": 20.0}
WORK = {
    "trace": lambda model: model.trace.f,
    "equations": lambda model: equations(model.structure, ("velocity",), ("m",)),
    "exact": lambda model: exact_tape(model.structure),
    "smooth": lambda model: smooth_tape(model.structure, 7),
    "linear": lambda model: linear_tape(model.structure, 7, "optimal"),
    "delay": lambda model: model.delay,
    "rate": lambda model: force_equations(model.structure).rate,
}


@pytest.fixture
def most_at_once(monkeypatch):
    """Count the threads that write expressions at the same time; the most so far is in the list."""
    inside, most, lock = set(), [0], threading.Lock()

    def watched(name):
        original = getattr(ca, name)

        def called(*args, **kwargs):
            with lock:
                inside.add(threading.get_ident())
                most[0] = max(most[0], len(inside))
            time.sleep(1e-4)
            try:
                return original(*args, **kwargs)
            finally:
                with lock:
                    inside.discard(threading.get_ident())

        monkeypatch.setattr(ca, name, called)

    for name in ("vertcat", "jacobian", "densify", "Function"):
        watched(name)
    return most


def new_models(count: int) -> list[Model]:
    """Return models of structures that nothing has been written for, as their effects have names of their own."""
    base = Model.from_dict({"plant": "mass_spring_damper", "parameters": PARAMETERS})
    unheard = f"at_{time.monotonic_ns()}"
    return [base.with_effect("coulomb_friction", key=f"{unheard}_{i}") for i in range(count)]


@pytest.mark.parametrize("what", WORK)
def test_expressions_are_written_by_one_thread_at_a_time(most_at_once, what):
    with ThreadPoolExecutor(4) as threads:
        for _ in threads.map(WORK[what], new_models(12)):
            pass
    assert most_at_once == [1]


def test_threads_that_ask_for_different_things_do_not_wait_for_each_other_forever():
    jobs = [(work, model) for model in new_models(4) for work in WORK.values()]
    with ThreadPoolExecutor(4) as threads:
        running = [threads.submit(work, model) for work, model in jobs]
        for one in running:
            one.result(timeout=60)


def test_what_a_thread_has_traced_is_never_forgotten_in_another():
    model = new_models(1)[0]
    assert model.trace is model.with_parameters({"m": 2.0}).trace
