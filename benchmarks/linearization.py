"""(a) One linear model of the Bouc-Wen oscillator: this package, python-control, and NumPy by hand."""

from __future__ import annotations

import control
import numpy as np
from bouc_wen import BoucWenByHand
from measure import Report, Timing, timed

from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model

POINTS = 20_000
AGREEMENT = 1e-9


def run(report: Report) -> None:
    report.section("Linearization: Bouc-Wen oscillator, 3 states (config/bouc_wen.yaml)")
    model = Model.load("bouc_wen").with_options(operating_point="start")
    hand = BoucWenByHand(model.parameters, model.sign_order, model.sign_scale)
    system = control.nlsys(hand.rhs, None, inputs=1, states=3, outputs=3)
    points = np.random.default_rng(1).uniform(-1.0, 1.0, (POINTS, 3))
    inputs = np.zeros((POINTS, 1))
    x, u = points[0].copy(), np.array([0.0])
    optimal, jacobian = Linearizer(model, "optimal"), Linearizer(model, "jacobian")
    check(report, optimal, jacobian, hand, system, points)
    found = timed(
        {
            "call": (lambda: optimal(x, u), 5000),
            "jacobian": (lambda: jacobian(x, u), 5000),
            "control": (lambda: control.linearize(system, x, u), 200),
            "hand": (lambda: hand.linearize(x), 5000),
            "batch": (lambda: optimal.batch(points, inputs), 1),
            "hand batch": (lambda: hand.batch(points), 1),
        },
        repeats=15,
    )
    show(report, found)


def show(report: Report, found: dict[str, Timing]) -> None:
    report.timing("one call", "Linearizer(model)(x, u), A_k, B_k, c", found["call"])
    report.timing("one call, jacobian", "the same, method jacobian", found["jacobian"])
    report.timing("python-control", "python-control linearize, Jacobian only", found["control"])
    report.timing("by hand", "NumPy by hand, A_k, B_k", found["hand"])
    report.timing("batch", f"Linearizer.batch, {POINTS} points, per point", found["batch"], points=POINTS)
    report.timing("by hand, batch", "NumPy by hand on arrays, per point", found["hand batch"], points=POINTS)
    faster = found["control"].median / found["call"].median
    report.ratio("python-control / one call", "python-control / one call", faster)
    report.ratio("by hand / one call", "NumPy by hand / one call", found["hand"].median / found["call"].median)
    arrays = found["hand batch"].median / found["batch"].median
    report.ratio("by hand / batch", "NumPy by hand on arrays / batch", arrays)
    report.target("one call, times faster than python-control", faster, low=20)
    report.target("one call", found["call"].median * 1e6, high=5, unit="µs")
    report.target("batch, times faster than NumPy by hand on arrays", arrays, low=1)
    report.target("batch, per point", found["batch"].median / POINTS * 1e6, high=0.08, unit="µs")


def check(
    report: Report, optimal: Linearizer, jacobian: Linearizer, hand: BoucWenByHand, system: object, points: np.ndarray
) -> None:
    """Say how far the three agree, before any of them is timed."""
    A, B = hand.batch(points)
    ours = optimal.batch(points)
    differences = [np.abs(ours.A - A).max(), np.abs(ours.B - B).max(), np.abs(ours.c).max()]
    for point in points[:200]:
        one, by_hand = optimal(point, [0.0]), hand.linearize(point)
        differences += [np.abs(one.A - by_hand[0]).max(), np.abs(one.B - by_hand[1]).max()]
    report.target("largest difference from NumPy by hand", float(max(differences)), high=AGREEMENT)
    peer = [control.linearize(system, point, [0.0]).A - jacobian(point, [0.0]).A for point in points[:20]]
    report.line("python-control's finite differences are off by", f"{np.abs(peer).max():10.2g}")
