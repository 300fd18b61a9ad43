"""Malformed messages: length x value x layout x order, drawn with a fixed seed."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

LENGTHS = (0, 1, 2, 3, 7, 200)
VALUES = (0.0, -0.0, 1.0, math.nan, math.inf, -math.inf, 5e-324, -1e-310, 1e308, -1.7e308, 1e150)
LAYOUTS = ("empty", "right", "wrong size", "wrong stride", "overflow", "zero", "offset", "too many", "square")
UINT32 = 2**32 - 1


def layout(message: Float64MultiArray, kind: str) -> None:
    """Give a message a layout of a kind."""
    n = len(message.data)
    dims = {
        "empty": [],
        "right": [(n, n)],
        "wrong size": [(n + 1, n + 1)],
        "wrong stride": [(n, n + 5)],
        "overflow": [(65536, 0), (65536, UINT32), (n, UINT32)],
        "zero": [(0, 0)],
        "offset": [(n, n)],
        "too many": [(1, n)] * 50 + [(n, n)],
        "square": [(n, n * n), (n, n)],
    }[kind]
    message.layout.dim = [MultiArrayDimension(label="x", size=s, stride=t) for s, t in dims]
    message.layout.data_offset = UINT32 if kind == "offset" else 0


def malformed(count: int, seed: int = 2026) -> Iterator[Float64MultiArray]:
    """Yield messages of every length, kind of value and layout, in a random order; a few are good."""
    rng = np.random.default_rng(seed)
    cases = [(n, v, k) for n in LENGTHS for v in VALUES for k in LAYOUTS]
    order = np.concatenate([rng.permutation(len(cases)) for _ in range(count // len(cases) + 1)])[:count]
    for index in order:
        length, value, kind = cases[index]
        data = rng.normal(0.0, 3.0, length)
        data[rng.permutation(length)[: max(1, length // 2)]] = value
        message = Float64MultiArray(data=data.tolist())
        layout(message, kind)
        yield message
