"""The inverse model: the effort that the measured motion should have taken, beside the effort that was measured.

They differ by the missing force: the same band, low-pass and samples as in the diagnosis (`comparison.piece`) [the
convention of robotics: Gautier, Janot and Vandanjon, IEEE Trans. Control Systems Technology 21 (2013) 428].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.force_segment import (
    ForceSegment,
    best_cutoff,
    force_segment,
    missing_force,
    recorded,
    stamped,
    tells_force,
)
from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.records import ModelData

Array = NDArray[np.float64]


@dataclass(frozen=True)
class InverseError:
    """How far the computed effort is off, behind the low-pass: ``name`` and ``unit`` of the effort, ``rmse`` in that
    unit, 100 |tau - tauhat| / |tau| (None without effort), ``cutoff_hz``; every ``decimation``-th sample is compared.
    """

    name: str
    unit: str
    rmse: float
    relative_error_percent: float | None
    cutoff_hz: float
    decimation: int

    def to_json(self) -> dict[str, float | str | int | None]:
        """Return the entry of the contract, with the filter that was used."""
        return {name: value for name, value in asdict(self).items() if name != "name"}


@dataclass(frozen=True)
class Efforts:
    """The effort ``name`` of records, ``step`` s from sample to sample, measured and computed: (K,) over all pieces."""

    name: str
    step: float
    pieces: tuple[ForceSegment, ...]

    @classmethod
    def of(cls, model: Model, parts: Sequence[ModelData], share: float, cutoff: float | None = None) -> Efforts | None:
        """Return the efforts of records without gaps; None where motion or effort is not known, or nothing moves.
        ``cutoff`` in Hz, under half the sampling rate (`InputError`); by default noise is a ``share`` of effort there.
        """
        name, known = model.plant.effort or "current", recorded(model, parts)
        if name not in known or not tells_force(model, known):
            return None
        step = float(np.median(np.concatenate([np.diff(part.t) for part in parts])))
        if cutoff is None:
            cutoff = float(f"{best_cutoff(model, parts, share):.3g}")
        elif not 0 < cutoff < 0.5 / step:
            half = f"half the sampling rate, {0.5 / step:g} Hz"
            raise InputError(f"cutoff: found {cutoff:g} Hz; allowed: above 0 and below {half}")
        moving = tuple(one for one in (force_segment(model, part, cutoff) for part in parts) if one.moves)
        return cls(name, step, moving) if moving else None

    def inverse(self, model: Model, units: Mapping[str, str]) -> InverseError:
        """Return the error of a model's effort computed from the motion; ``units`` of the record."""
        name, unit = self.name, units.get(self.name) or model.units[self.name]
        if name == "current":
            name, unit = "torque", model.plant.force_unit
        first, size = self.pieces[0], float(np.sqrt(np.mean(self.measured**2)))
        left = stamped(self.missing(model), self._seen(lambda p: p.late))
        rmse = float(np.sqrt(np.mean(left**2)))
        every = round(first.step * float(np.diff(first.kept).min()) / self.step)
        return InverseError(name, unit, rmse, 100.0 * rmse / size if size > 0 else None, first.cutoff, every)

    @cached_property
    def measured(self) -> Array:
        """The measured effort (K,)."""
        return self._seen(lambda p: p.effort)

    def missing(self, model: Model) -> Array:
        """Return the effort (K,) that the motion takes beyond the measured one by a model of the same plant."""
        return self._seen(lambda p: missing_force(model, p))

    def along(self, model: Model, name: str) -> Array | None:
        """Return a velocity or position (K,) through the same low-pass; None where the model has none of this name."""
        known = name in (*model.inputs, *model.states)
        return self._seen(lambda p: p.values[name]) if known else None

    def _seen(self, shown: Callable[[ForceSegment], Array]) -> Array:
        return np.concatenate([p.seen(shown(p)) for p in self.pieces])


__all__ = ["Efforts", "InverseError"]
