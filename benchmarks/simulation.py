"""(b) Exact simulation of a stick-slip motor: this package beside SciPy's solve_ivp with events, at equal accuracy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from measure import Report, timed
from numpy.typing import NDArray
from stick_slip import StickSlipMotor

from signlin_ros.model import Model
from signlin_ros.simulation import simulate

Array = NDArray[np.float64]
Run = Callable[[float], Array]
ACCURACY, FINE = 1e-6, 1e-9
"""Wanted errors, as shares of the speed's standard deviation."""


def motor() -> Model:
    """The paper's motor with Stribeck friction instead of Coulomb's."""
    plain = Model.load("dc_motor").without_effect("coulomb_friction")
    return plain.with_effect("stribeck_friction", mu=0.025, excess=0.03, v_s=2.5)


def voltage() -> tuple[Array, Array]:
    """16 s of a slow sine and a faster one beside it, held for 5 ms each: the motor sticks at every reversal."""
    t = np.linspace(0.0, 16.0, 3201)
    u = 1.2 * np.sin(2 * np.pi * 0.25 * t) + 0.4 * np.sin(2 * np.pi * 0.9 * t + 0.5)
    return t, u


def tuned(run: Run, reference: Array, accuracy: float) -> tuple[float, float]:
    """Return the coarsest tolerance whose speed is as accurate as wanted, and its error (RMS over deviation)."""

    def error(rtol: float) -> float:
        return float(np.sqrt(np.mean((run(rtol) - reference) ** 2)) / reference.std())

    fine = next((k for k in np.arange(1.0, 12.0) if error(10.0**-k) <= accuracy), np.nan)
    coarse = fine - 1.0 if fine > 1.0 else fine
    while fine - coarse > 0.04:
        middle = 0.5 * (coarse + fine)
        coarse, fine = (coarse, middle) if error(10.0**-middle) <= accuracy else (middle, fine)
    return float(10.0**-fine), error(10.0**-fine)


def peer(model: Model, method: str, t: Array, u: Array, rtol: float) -> Array:
    """Return the speed by solve_ivp."""
    friction = model.effects["stribeck_friction"].parameters
    return StickSlipMotor(model.parameters, friction, method, rtol, rtol * 1e-2).run(t, u)[:, 1]


def run(report: Report) -> None:
    model, (t, u) = motor(), voltage()
    report.section("Exact simulation: motor with Stribeck friction, 16 s, 3200 held samples, stick and slip")
    reference = peer(model, "DOP853", t, u, 1e-12)
    runs: dict[str, Run] = {
        "signlin_ros": lambda rtol: simulate(model, t, u, rtol=rtol)["speed"],
        **{name: lambda rtol, name=name: peer(model, name, t, u, rtol) for name in ("RK45", "DOP853")},  # type: ignore[misc]
    }
    ours = simulate(model, t, u, rtol=1e-13)
    difference = float(np.sqrt(np.mean((ours["speed"] - reference) ** 2)) / reference.std())
    report.line("reference", "solve_ivp, DOP853, rtol 1e-12")
    report.line("signlin_ros at rtol 1e-13 differs from it by", f"{difference:10.2g} of the speed's deviation")
    report.line("events", f"{len(ours.events)}; stuck for {100 * np.mean(ours['speed'] == 0):.0f} % of the time")
    faster = [compare(report, runs, reference, accuracy) for accuracy in (ACCURACY, FINE)]
    report.target(f"times faster than solve_ivp at {ACCURACY:g}", faster[0], low=20)


def compare(report: Report, runs: dict[str, Run], reference: Array, accuracy: float) -> float:
    """Time all at one accuracy; return how many times faster this package is than the fastest peer."""
    found = {name: tuned(run, reference, accuracy) for name, run in runs.items()}
    times = timed(
        {name: (lambda name=name: runs[name](found[name][0]), 5 if name == "signlin_ros" else 1) for name in runs},  # type: ignore[misc]
        repeats=7,
    )
    report.line(f"at an error of {accuracy:g} of the deviation", "(each at the coarsest rtol that reaches it)")
    for name, timing in times.items():
        rtol, error = found[name]
        label = f"  {name}, rtol {rtol:.2g}, error {error:.1e}"
        report.timing(f"stick-slip {name} at {accuracy:g}", label, timing, "ms")
    fastest = min(("RK45", "DOP853"), key=lambda name: times[name].median)
    ratio = times[fastest].median / times["signlin_ros"].median
    report.ratio(f"solve_ivp / simulate at {accuracy:g}", f"  solve_ivp ({fastest}) / signlin_ros", ratio)
    return ratio
