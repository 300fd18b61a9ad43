"""Whether a machine has changed, and when: a CUSUM on how badly a model predicts, against what was usual.

The filter's innovations, in their standard deviations, are taken in blocks. What is usual of a block's size (the
logarithm of its mean square) and of the trace that a shift would leave is learnt while all is well. A block that is
larger than any usual one adds to a sum, others take from it; the sum passes a bound within a block or two where a
machine changes, and began to rise when it did [CUSUM: Page, Biometrika 41 (1954) 100; Basseville and Nikiforov,
Detection of Abrupt Changes, 1993, sec. 2.2]. A sensor that shifts leaves a trace of a known form in the innovations
before a block is full, and a single wild value one of another form; a force that appears leaves a run of samples to
one side [generalized likelihood ratio: Willsky and Jones,
IEEE Trans. Automatic Control 21 (1976) 108].
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCK_SECONDS = 0.25
"""Seconds in a block."""
MIN_BLOCK_SAMPLES = 8
"""Samples in a block at least."""
MAX_SQUARED_INNOVATION = 50.0
"""A squared innovation counts so much at most: one wild sample is no change."""
BLOCK_MARGIN = 0.7
"""By how much the logarithm of a block's mean square must pass the largest usual one to count."""
BOUND = 1.2
"""Sum of what blocks have beyond that at which a change is called."""
FORGIVEN = 0.4
"""A usual block takes at most so much from the sum."""
RUNS = (2, 3, 5)
"""So many samples to one side are a change; a single one is a wild value."""
MIN_RUN_MEAN = 2.5
"""What the other values of a run must be on the mean, beside the largest."""
RUN_MARGIN, RUN_FLOOR = 1.5, 6.5
"""A run's size against the largest usual one of any situation, some seen for seconds only; and at least."""
LEANING = (10, 20, 40)
"""The mean over so many samples is a change as well, if it lies that far to one side (`RUN_MARGIN`),"""
LEANING_FLOOR, CUT = 6.0, 4.0
"""in so many of its standard deviations at least: white noise does so once in a thousand hours at 200 Hz. One sample
counts so many of its own at most."""
SHIFT_MARGIN, SHIFT_FLOOR = 1.3, 6.0
"""A shift's size, in standard deviations, against the largest usual one of any situation, and at least."""
LIKER = 1.15
"""By how much a trace must be more like that of a shift than like that of a wild value."""
EARLIER = 2
"""Samples before a shift that are looked at, too: a wild value may have been there, a shift leaves them as usual."""
MAX_SHIFT_RESIDUAL, MAX_FORM_RESIDUAL = 24.0, 0.3
"""What a shift may leave unexplained, in variances (1 - p of 0.1 % for 7 of them), and as a share of its size."""
MIN_SITUATION_BLOCKS, MIN_RUN_BLOCKS = 12, 4
"""Blocks of a situation that must be known before one is called unusual, and before a run or a shift in it is."""


@dataclass(frozen=True)
class Alarm:
    """A change: when it was called and when it began, in s; ``kind`` is "shift" (of a sensor) or "change"."""

    t: float
    onset: float
    kind: str


@dataclass
class _Usual:
    """What was seen in one situation: sizes of blocks and of shifts while all was well; the sum of what passes them."""

    blocks: list[float] = field(default_factory=list)
    runs: list[float] = field(default_factory=list)
    leanings: list[float] = field(default_factory=list)
    shifts: list[float] = field(default_factory=list)
    sum: float = 0.0
    onset: float = float("nan")

    @property
    def known(self) -> bool:
        """Whether enough was seen to call a block unusual."""
        return len(self.blocks) >= MIN_SITUATION_BLOCKS

    @property
    def seen(self) -> bool:
        """Whether enough was seen to call a run or a shift unusual."""
        return len(self.blocks) >= MIN_RUN_BLOCKS

    @property
    def block(self) -> float:
        """The largest usual block: the largest seen, or what a normal distribution of them would still hold."""
        sizes = np.array(self.blocks)
        middle = float(np.median(sizes))
        spread = float(np.percentile(sizes, 84) - middle)
        return max(float(sizes.max()), middle + 3.0 * spread, 0.0)

    @property
    def run(self) -> float:
        """The largest usual run."""
        return max(self.runs, default=0.0)

    @property
    def leaning(self) -> float:
        """The largest usual mean to one side."""
        return max(self.leanings, default=0.0)

    @property
    def shift(self) -> float:
        """The largest usual size of a shift."""
        return max(self.shifts, default=0.0)

    def learn(self, size: float, run: float, leaning: float, shift: float) -> None:
        """Take a block as usual."""
        self.blocks.append(size)
        self.runs.append(run)
        self.leanings.append(leaning)
        self.shifts.append(shift)

    def passed(self, start: float, size: float, margin: float) -> bool:
        """Take a block that begins at ``start`` s; returns whether the sum passes its bound."""
        beyond = size - self.block - margin
        if self.sum <= 0.0 < beyond:
            self.onset = start
        self.sum = max(0.0, self.sum + max(beyond, -FORGIVEN))
        return self.sum > BOUND


class ShiftTrace:
    """How like the trace of a shift the last innovations of a channel are.

    ``signature`` (L,): what a shift adds to the innovations from its first sample on, whatever its size.
    """

    def __init__(self, signature: Array) -> None:
        size = signature.size
        wild = np.concatenate([np.zeros(size + EARLIER), np.diff(signature, prepend=0.0), np.zeros(size)])
        before = np.zeros(EARLIER)
        others = np.array([wild[size - late : 2 * size + EARLIER - late] for late in range(-EARLIER, size)])
        forms = np.vstack([np.concatenate([before, signature]), others])
        self._forms = forms / np.linalg.norm(forms, axis=1, keepdims=True)
        self._times: deque[float] = deque(maxlen=forms.shape[1])
        self._last: deque[float] = deque(maxlen=forms.shape[1])

    @property
    def begun(self) -> float:
        """When the shift that is looked for begins, in s."""
        return self._times[EARLIER]

    def take(self, t: float, z: float) -> tuple[float, float]:
        """Take an innovation; returns the size of a shift at `begun`, 0 where it explains them not, and of a wild one.

        A wild value must be less like what is seen, and what the shift leaves must be usual, before it as well.
        """
        self._times.append(t)
        self._last.append(z)
        if len(self._last) < self._forms.shape[1]:
            return 0.0, 0.0
        last = np.array(self._last)
        found = np.abs(self._forms @ last)
        shift, wild = float(found[0]), float(found[1:].max())
        explained = float(last @ last) - shift**2 <= MAX_SHIFT_RESIDUAL + (MAX_FORM_RESIDUAL * shift) ** 2
        return (shift if explained and shift > LIKER * wild else 0.0), wild


class Leaning:
    """How far the last innovations of a channel lie to one side, on the mean over some lengths."""

    def __init__(self) -> None:
        self._times: deque[float] = deque(maxlen=LEANING[-1] + 1)
        self._sums: deque[float] = deque([0.0], maxlen=LEANING[-1] + 1)

    def take(self, t: float, z: float) -> tuple[float, float]:
        """Take an innovation; returns the largest of the means, in their standard deviations, and when it began."""
        self._times.append(t)
        self._sums.append(self._sums[-1] + min(max(z, -CUT), CUT))
        size, begun = 0.0, t
        for length in LEANING:
            if len(self._sums) > length:
                found = abs(self._sums[-1] - self._sums[-1 - length]) / length**0.5
                if found > size:
                    size, begun = found, self._times[-length]
        return size, begun


class ChangeDetector:
    """Takes innovations in their standard deviations, learns for ``learn`` s what is usual, then tells of changes.

    What is usual differs by situation (in motion, near a reversal, at rest): a whole number that comes with each
    sample; a block belongs to the largest in it. A situation that is new is learnt first. After an `Alarm` it stays:
    ``alarm`` holds it until `restart`. ``signatures`` by number of the channel: see `ShiftTrace`; a channel without
    one is not asked for shifts.
    """

    def __init__(
        self, learn: float = 30.0, margin: float = BLOCK_MARGIN, signatures: Mapping[int, Array] | None = None
    ) -> None:
        self.learn, self.margin, self.signatures = learn, margin, dict(signatures or {})
        self.restart()

    def restart(self) -> None:
        """Learn anew what is usual."""
        self._usual: dict[int, _Usual] = {}
        self.alarm: Alarm | None = None
        self._begun, self._block_start, self._situation = np.nan, np.nan, 0
        self._block: list[float] = []
        self._traces = {channel: ShiftTrace(form) for channel, form in self.signatures.items()}
        self._runs: dict[int, deque[float]] = {}
        self._leanings: dict[int, Leaning] = {}
        self._run_max = self._leaning_max = self._shift_max = 0.0
        self._waiting: tuple[float, float, int] | None = None
        self.size = np.nan

    @property
    def learning(self) -> bool:
        """Whether it is still being learnt what is usual."""
        return not self._block_start - self._begun >= self.learn

    @property
    def level(self) -> float:
        """How near the sum is to its bound: a change is called at 1."""
        return max((usual.sum for usual in self._usual.values()), default=0.0) / BOUND

    def take(
        self, t: Array, z: Array, situation: NDArray[np.int64] | None = None, channel: NDArray[np.int64] | None = None
    ) -> Alarm | None:
        """Take innovations z (E,) at times t (E,), in their standard deviations; returns a change as it is called."""
        before = self.alarm
        none = np.zeros(t.size, dtype=np.int64)
        kinds = none if situation is None else situation
        channels = none if channel is None else channel
        for when, value, kind, c in zip(t.tolist(), z.tolist(), kinds.tolist(), channels.tolist(), strict=True):
            self._take(when, value, kind, c)
        return self.alarm if before is None else None

    def _take(self, t: float, z: float, situation: int, channel: int) -> None:
        if self._begun != self._begun:
            self._begun = self._block_start = t
        if t - self._block_start >= BLOCK_SECONDS and len(self._block) >= MIN_BLOCK_SAMPLES:
            self._end_block()
            self._block_start = t
        self._situation = max(self._situation, situation)
        run, shift, wild = self._run_of(channel, z), 0.0, 0.0
        leaning, leant = self._leanings.setdefault(channel, Leaning()).take(t, z)
        if channel in self._traces:
            shift, wild = self._traces[channel].take(t, z)
        self._run_max, self._shift_max = max(self._run_max, run), max(self._shift_max, shift)
        self._leaning_max = max(self._leaning_max, leaning)
        self._look(t, channel, (run, shift, wild))
        self._look_back(t, leaning, leant)
        self._block.append(min(z * z, MAX_SQUARED_INNOVATION))

    def _run_of(self, channel: int, z: float) -> float:
        last = self._runs.setdefault(channel, deque(maxlen=RUNS[-1]))
        last.append(z)
        return _run_size(list(last))

    @property
    def _judging(self) -> bool:
        """Whether enough is known of the situation to call a change in it, and none was called."""
        usual = self._usual.get(self._situation)
        return not self.learning and self.alarm is None and usual is not None and usual.seen

    def _look(self, t: float, channel: int, sizes: tuple[float, float, float]) -> None:
        """Call a shift, or a change by a run; what a run is the beginning of, or the end, shows some samples later."""
        run, shift, wild = sizes
        if not self._judging:
            return
        if shift > max(SHIFT_MARGIN * max(known.shift for known in self._usual.values()), SHIFT_FLOOR):
            self.alarm = Alarm(t, self._traces[channel].begun, "shift")
        elif self._waiting is not None:
            onset, size, left = self._waiting
            self._waiting = (onset, size, left - 1) if wild < size else None
            self.alarm = Alarm(t, onset, "change") if self._waiting and left == 1 else None
        elif run > max(RUN_MARGIN * max(known.run for known in self._usual.values()), RUN_FLOOR):
            self._waiting = (t, run, max((f.size for f in self.signatures.values()), default=1))

    def _look_back(self, t: float, leaning: float, begun: float) -> None:
        """Call a change by a mean that lies to one side since ``begun`` s."""
        if not self._judging:
            return
        if leaning > max(RUN_MARGIN * max(known.leaning for known in self._usual.values()), LEANING_FLOOR):
            self.alarm = Alarm(t, begun, "change")

    def _end_block(self) -> None:
        size = float(np.log(np.mean(self._block) + 1e-12))
        usual = self._usual.setdefault(self._situation, _Usual())
        if self.learning or not usual.known:
            usual.learn(size, self._run_max, self._leaning_max, self._shift_max)
        elif usual.passed(self._block_start, size, self.margin) and self.alarm is None:
            self.alarm = Alarm(self._block_start + BLOCK_SECONDS, usual.onset, "change")
        self.size, self._block, self._situation = size, [], 0
        self._run_max = self._leaning_max = self._shift_max = 0.0


def _run_size(values: list[float]) -> float:
    """Return the largest sum over its root's length of the last values that are all to one side.

    All but the largest must be `MIN_RUN_MEAN` on the mean: one wild value beside a usual one is no run.
    """
    size = 0.0
    for length in RUNS:
        last = [abs(value) for value in values[-length:]]
        same = min(values[-length:]) > 0 or max(values[-length:]) < 0
        if len(last) == length and same and sum(last) - max(last) >= MIN_RUN_MEAN * (length - 1):
            size = max(size, sum(last) / length**0.5)
    return size


__all__ = ["Alarm", "ChangeDetector"]
