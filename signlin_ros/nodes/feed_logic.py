"""What a page is told of a running system: the extremes of every signal since the last frame, and how good A_k is.

No rclpy here. Samples arrive one by one and are kept for a minute; a frame is made some twenty times a second and holds
at most four points of each signal, so that a minute of it never has more than 5,000.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KEPT_TIME = 60.0
"""Seconds of samples that are kept, for "take the last ... s as a record"."""
MAX_KEPT_SAMPLES = 200_000
"""Samples that are kept at most, whatever their rate."""
POINTS_PER_FRAME = 4
"""Points of a signal in a frame."""
MAX_MODEL_GAP = 0.2
"""A model that came with a gap of more than this many periods to the one before is not held to its prediction."""


class FeedChannel:
    """One topic of numbers: times (s) and rows that have come; those not shown yet, and those of the last minute."""

    def __init__(self) -> None:
        self.kept: deque[tuple[float, Array]] = deque(maxlen=MAX_KEPT_SAMPLES)
        self.fresh: list[tuple[float, Array]] = []
        self.count = 0

    def put(self, t: float, row: Array) -> None:
        """Take a sample; one of another length than before begins anew."""
        if self.kept and self.kept[-1][1].size != row.size:
            self.kept.clear()
            self.fresh.clear()
        self.kept.append((t, row))
        self.fresh.append((t, row))
        self.count += 1

    @property
    def last(self) -> tuple[float, Array] | None:
        """The newest sample."""
        return self.kept[-1] if self.kept else None

    def forget(self, now: float) -> None:
        """Forget what is older than a minute."""
        while self.kept and self.kept[0][0] < now - KEPT_TIME:
            self.kept.popleft()

    def shown(self) -> dict[str, Any] | None:
        """Return first, lowest, highest and last of what is fresh, by column; None where nothing is."""
        if not self.fresh:
            return None
        t = np.array([s[0] for s in self.fresh])
        rows = np.stack([s[1] for s in self.fresh])
        self.fresh = []
        at = [_extremes(column) for column in rows.T]
        return {
            "t": [[round(float(t[i]), 6) for i in k] for k in at],
            "y": [[_plain(column[i]) for i in k] for k, column in zip(at, rows.T, strict=True)],
        }


def _extremes(column: Array) -> list[int]:
    """Return where first, lowest, highest and last stand, in order, each once."""
    filled = np.where(np.isfinite(column), column, 0.0)
    found = {0, int(filled.argmin()), int(filled.argmax()), column.size - 1}
    return sorted(found)[:POINTS_PER_FRAME]


def _plain(value: float) -> float | None:
    return float(f"{value:.7g}") if math.isfinite(value) else None


class Feed:
    """States, inputs and models as they come; `frame` is what the page gets."""

    def __init__(self) -> None:
        self.state, self.input, self.error = FeedChannel(), FeedChannel(), FeedChannel()
        self.model: dict[str, Any] | None = None
        self._from: tuple[float, Array, Array, dict[str, Any]] | None = None
        self._told = False

    def take_model(self, now: float, n: int, m: int, valid: bool, values: Sequence[Array]) -> None:
        """Take a linear model (A (n, n), B (n, m), c (n,)) that came at ``now``; judge the one before by what came."""
        A, B, c = values
        self._judge(now)
        self.model = {
            "t": now,
            "A": A.tolist(),
            "B": B.tolist(),
            "c": c.tolist(),
            "in_valid_range": valid,
            "poles": [[float(p.real), float(p.imag)] for p in np.linalg.eigvals(A)],
        }
        self._told = False
        state, driven = self.state.last, self.input.last
        u = driven[1] if driven is not None and driven[1].size == m else np.zeros(m)
        if state is not None and state[1].size == n:
            self._from = (state[0], state[1], u, {"A": A, "B": B, "c": c})

    def _judge(self, now: float) -> None:
        """Note by how much the state is off that the last model predicted from where it began."""
        state = self.state.last
        if self._from is None or state is None:
            return
        begun, x, u, model = self._from
        if state[1].size != x.size or not begun < state[0] <= now + MAX_MODEL_GAP:
            return
        driven = [row for t, row in self.input.kept if begun <= t < state[0] and row.size == u.size]
        mean = np.mean([u, *driven], axis=0) if driven else u
        self.error.put(state[0], state[1] - predicted(model["A"], model["B"], model["c"], x, mean, state[0] - begun))

    def frame(self, now: float) -> dict[str, Any]:
        """Return the messages since the last frame."""
        found: dict[str, Any] = {"now": now, "samples": self.state.count}
        for name, channel in (("state", self.state), ("input", self.input), ("error", self.error)):
            channel.forget(now)
            shown = channel.shown()
            if shown is not None:
                found[name] = shown
        if self.model is not None and not self._told:
            found["model"], self._told = self.model, True
        return found

    def recorded(self, seconds: float) -> tuple[Array, Array, Array]:
        """Return times (T,) s from 0, states (T, n) and inputs (T, m) held, of the last seconds."""
        last = self.state.last
        if last is None:
            return np.empty(0), np.empty((0, 0)), np.empty((0, 0))
        chosen = [(t, row) for t, row in self.state.kept if t >= last[0] - seconds]
        t = np.array([s[0] for s in chosen])
        driven = list(self.input.kept)
        if not driven:
            return t - t[0], np.stack([s[1] for s in chosen]), np.zeros((t.size, 0))
        at = np.maximum(np.searchsorted([s[0] for s in driven], t, side="right") - 1, 0)
        return t - t[0], np.stack([s[1] for s in chosen]), np.stack([driven[i][1] for i in at])


def predicted(A: Array, B: Array, c: Array, x: Array, u: Array, span: float) -> Array:
    """Return the state (n,) that x' = A x + B u + c reaches from x after ``span`` s with u held."""
    from scipy.linalg import expm

    n = x.size
    block = np.zeros((n + 1, n + 1))
    block[:n, :n], block[:n, n] = A, B @ u + c
    return np.asarray((expm(block * span) @ np.concatenate([x, [1.0]]))[:n])


__all__ = ["Feed", "FeedChannel", "predicted"]
