"""Figure 3: the tangent T and the line L through origin and operating point, of a drive's friction.

The scalar system of (13) is a shaft that coasts against friction which falls after breakaway (Stribeck): J and mu are
those of the paper's motor. There the tangent's slope is positive, so that its A alone is an unstable drive; L brakes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros import plotting
from signlin_ros.linearization import Linearization, Linearizer, linearize
from signlin_ros.model import Model
from signlin_ros.simulation import simulate

Array = NDArray[np.float64]
LINE_SPEED, MAX_DRAWN_SPEED, COASTING = 2.0, 8.0, 0.25
"""Operating point and largest speed drawn in rad/s; how long the shaft coasts in s."""
TANGENT_COLOUR, LINE = plotting.JACOBIAN, plotting.START_COLOUR


def coasting_shaft() -> Model:
    """Return a free shaft with the inertia and the sliding friction of `dc_motor`, and an excess at breakaway."""
    motor = Model.load("dc_motor")
    mu, J = motor.value("coulomb_friction.mu"), motor.value("J")
    free = {"m": J, "c": 0.0, "k": 0.0}
    options = {"sign_order": motor.sign_order, "sign_scale": motor.sign_scale, "linearization": "termwise"}
    model = Model.from_dict({"plant": "mass_spring_damper", "parameters": free, **options})
    return model.with_effect("stribeck_friction", mu=mu, excess=mu, v_s=LINE_SPEED)


def tangent_and_line(model: Model, speed: float) -> tuple[Linearization, Linearization]:
    """Return T, x' = f'(x_k) x + c, and L, x' = f(x_k)/x_k x, at a speed in rad/s."""
    point = [0.0, speed]
    return linearize(model, point, method="jacobian"), linearize(model, point, method="termwise")


def draw_lines(path: Path) -> None:
    """Draw Fig. 3: f, T and L; beside it the slopes of both at every speed, and where each says the shaft coasts to."""
    model = coasting_shaft()
    T, L = tangent_and_line(model, LINE_SPEED)
    with plotting.canvas(path, 10.4, 4.0) as figure:
        curve, slopes, coasting = figure.subplots(1, 3)
        _draw_curve(curve, model, T, L)
        _draw_slopes(slopes, model)
        _draw_coasting(coasting, model, T, L)
        plotting.legend_above(figure, curve, 4)


def _draw_curve(axes: Any, model: Model, T: Linearization, L: Linearization) -> None:
    v = np.linspace(-1.0, MAX_DRAWN_SPEED, 1801)
    f = Linearizer(model).batch(np.column_stack([0 * v, v])).f[:, 1]
    axes.plot(v, f, color=plotting.EXACT_COLOUR, lw=2.0, label="f$_j$")
    axes.plot(v, T.A[1, 1] * v + T.c[1], color=TANGENT_COLOUR, label="T, the tangent: affine")
    axes.plot(v, L.A[1, 1] * v, color=LINE, label="L, through the origin: linear")
    axes.plot(v, T.A[1, 1] * v, color=TANGENT_COLOUR, ls=":", label="T without its constant")
    axes.plot(LINE_SPEED, T.f[1], "o", color=plotting.EXACT_COLOUR)
    axes.annotate("x$_k$", (LINE_SPEED, T.f[1]), (9, -5), textcoords="offset points")
    axes.set(xlabel="speed x  [rad/s]", ylabel="x'  [rad/s²]", xlim=(v[0], v[-1]), ylim=(-50, 40))
    axes.set_title("Friction of a coasting shaft")


def _draw_slopes(axes: Any, model: Model) -> None:
    v = np.linspace(0.3, MAX_DRAWN_SPEED, 400)
    points = np.column_stack([0 * v, v])
    for method, colour, label in (("termwise", LINE, "L: f$_j$(x)/x"), ("jacobian", TANGENT_COLOUR, "T: f$_j$'(x)")):
        axes.plot(v, Linearizer(model, method).batch(points).A[:, 1, 1], color=colour, label=label)
    axes.axhline(0, color="#666666", lw=0.8)
    axes.axvline(LINE_SPEED, color="#666666", lw=0.8, ls=":")
    axes.set(xlabel="operating point x$_k$  [rad/s]", ylabel="A$_k$  [1/s]", xlim=(0, MAX_DRAWN_SPEED), ylim=(-40, 12))
    axes.set_title("The slope: above 0 is unstable")
    axes.legend(loc="lower right")


def _draw_coasting(axes: Any, model: Model, T: Linearization, L: Linearization) -> None:
    t = np.linspace(0, COASTING, 251)
    exact = simulate(model, t, np.zeros((t.size, 1)), [0.0, LINE_SPEED])["velocity"]
    axes.plot(t, exact, color=plotting.EXACT_COLOUR, lw=2.0)
    axes.plot(t, coasted(t, T.A[1, 1], T.c[1]), color=TANGENT_COLOUR)
    axes.plot(t, coasted(t, L.A[1, 1], 0.0), color=LINE)
    axes.plot(t, coasted(t, T.A[1, 1], 0.0), color=TANGENT_COLOUR, ls=":")
    axes.set(xlabel="time  [s]", ylabel="speed  [rad/s]", xlim=(0, t[-1]), ylim=(-4, 6))
    axes.set_title("Coasting from x$_k$, each model held")


def coasted(t: Array, a: float, c: float) -> Array:
    """Return x (T,) of x' = a x + c from `LINE_SPEED`, a not 0."""
    rest = -c / a
    return np.asarray(rest + (LINE_SPEED - rest) * np.exp(a * t))
