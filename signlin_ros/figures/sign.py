"""Figures 1 and 2: sign_j and its derivative for several orders; beyond them, what is made of sign_j, and its reach."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from signlin_ros import plotting
from signlin_ros.sign import sign_j, sign_j_slope, valid_surface

DRAWN_ORDERS = (4, 10, 20, 50)
"""The orders j that are drawn; all even, as for an odd one sign_j grows without bound (`draw_uses`)."""


def draw_values(path: Path) -> None:
    """Draw Fig. 1: sign_j for several orders, (a) on [-0.5, 0.5] by 0.01, (b) on [-10, 10] by 1."""
    with plotting.canvas(path, 9.0, 3.8) as figure:
        near, far = figure.subplots(1, 2, sharey=True)
        _draw_orders(near, np.linspace(-0.5, 0.5, 101), "-")
        _draw_orders(far, np.linspace(-10, 10, 21), "o-")
        near.set(xlabel="σ  [-]", ylabel="sign$_j$(σ)  [-]", title="(a) steps of 0.01", xlim=(-0.5, 0.5))
        far.set(xlabel="σ  [-]", title="(b) steps of 1", xlim=(-10, 10), xticks=range(-10, 11, 5))
        plotting.legend_above(figure, near, 5)


def _draw_orders(axes: Any, z: Any, marks: str) -> None:
    end = z[-1]
    axes.plot([-end, 0, 0, end], [-1, -1, 1, 1], color=plotting.EXACT_COLOUR, lw=1.0, ls="--", label="sign")
    for order, colour in zip(DRAWN_ORDERS, plotting.SEQUENCE, strict=True):
        axes.plot(z, sign_j(z, order), marks, ms=3, lw=1.2, color=colour, label=f"sign$_j$, j = {order}")


def draw_derivative(path: Path) -> None:
    """Draw Fig. 2: the derivative (10) for several orders on [-0.5, 0.5]; its peak, at 0, is the order j."""
    z = np.linspace(-0.5, 0.5, 1001)
    with plotting.canvas(path, 6.4, 3.8) as figure:
        axes = figure.subplots()
        for order, colour in zip(DRAWN_ORDERS, plotting.SEQUENCE, strict=True):
            axes.plot(z, sign_j_slope(z, order), color=colour, label=f"j = {order}")
            axes.plot(0, sign_j_slope(0.0, order), "o", ms=4, color=colour)
        axes.set(xlabel="σ  [-]", ylabel="d sign$_j$(σ) / dσ  [-]", xlim=(-0.5, 0.5), ylim=(0, None))
        axes.set_yticks([0, *DRAWN_ORDERS])
        axes.set_title("Derivative of sign$_j$: its largest value is the order j")
        axes.legend(loc="upper right")


def draw_uses(path: Path) -> None:
    """Draw |v| through sign_j, the friction coefficient that enters A, and where sign_j stops being a sign."""
    with plotting.canvas(path, 10.4, 3.5) as figure:
        magnitude, gain, reach = figure.subplots(1, 3)
        _draw_magnitude(magnitude)
        _draw_gain(gain)
        _draw_reach(reach)


def _draw_magnitude(axes: Any) -> None:
    v = np.linspace(-0.6, 0.6, 601)
    axes.plot(v, np.abs(v), color=plotting.EXACT_COLOUR, lw=1.0, ls="--", label="|v|")
    for order, colour in zip(DRAWN_ORDERS, plotting.SEQUENCE, strict=True):
        axes.plot(v, v * sign_j(v, order), color=colour, label=f"j = {order}")
    axes.set(xlabel="v  [scale]", ylabel="v sign$_j$(v)  [scale]", title="|v| through sign$_j$", xlim=(-0.6, 0.6))
    axes.legend(loc="upper center", ncols=1)


def _draw_gain(axes: Any) -> None:
    v = np.logspace(-3, 1.2, 400)
    axes.loglog(v, 1 / v, color=plotting.EXACT_COLOUR, lw=1.0, ls="--", label="sign(v) / v")
    for order, colour in zip((10, 50), (plotting.SEQUENCE[2], plotting.SEQUENCE[3]), strict=True):
        axes.loglog(v, sign_j(v, order) / v, color=colour, label=f"secant, j = {order}")
        axes.loglog(v, sign_j_slope(v, order), color=colour, ls=":", label=f"slope, j = {order}")
    axes.set(xlabel="|v|  [scale]", ylabel="sign$_j$(v)/v and d sign$_j$/dv  [1/scale]", title="What enters A")
    axes.set(ylim=(0.03, 3000), xlim=(1e-3, 16))
    axes.legend(loc="upper right", fontsize=8)


def _draw_reach(axes: Any) -> None:
    z = np.logspace(-2, 2.3, 600)
    for order, colour, text in (
        (50, plotting.MIDPOINT, "even: falls off"),
        (51, plotting.START_COLOUR, "odd: overshoots"),
    ):
        s, good = sign_j(z, order), valid_surface(z, order)
        axes.semilogx(z, s, color=colour, ls=":")
        axes.semilogx(z[good], s[good], color=colour, lw=2.0, label=f"j = {order}, {text}")
    axes.axhline(1, color=plotting.EXACT_COLOUR, lw=1.0, ls="--")
    axes.axvline(50 / 3, color="#666666", lw=0.8)
    axes.text(50 / 3 * 0.9, 0.06, "valid up to\nz = j/3", ha="right", color="#444444")
    axes.set(xlabel="z = v / scale  [-]", ylabel="sign$_j$(z)  [-]", title="Where it stops being a sign")
    axes.set(ylim=(0, 2.2), xlim=(0.01, 200))
    axes.legend(loc="upper left")
