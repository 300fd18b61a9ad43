"""States that are over long before the next sample: they follow at once [Khalil, Nonlinear Systems, 3rd ed., ch. 11].

A winding of 0.1 ms in a log of 200 Hz: the current that was read beside a voltage is that of the same instant, while
one that is integrated from sample to sample belongs to the voltage before. Nothing of the time constant is in such a
record, and a simulation pays for it with dozens of steps a sample.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.records.table import frozen

Array = NDArray[np.float64]

MIN_STEP_OVER_SETTLING = 10.0
"""Time constants in a step from which on a state follows at once."""
MIN_COMPARED_SAMPLES = 3
"""Samples from which on changes are compared."""
INSTRUMENTS = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0)
"""Time constants in samples of the low-passed inputs that foretell how the velocity changes."""


def with_settled(
    model: Model, data: Sequence[ModelData]
) -> tuple[Model, Callable[[ModelData], ModelData], tuple[str, ...]]:
    """Return a model whose states follow at once where they settle within a sample of every record, what this makes of
    a record, and the notes on it.

    Where the state is measured, it is of its sample's instant. Where it is not, its lag is a delay of the input: the
    two differ by the square of the time constant over the step. What was read before its input acted keeps its
    equation: there it is that of the input before.
    """
    step = min((float(np.median(np.diff(one.t))) for one in data if len(one) > 1), default=0.0)
    times = model.plant.settling_times(model.parameters)
    quick = {name: time for name, time in times.items() if 0.0 < MIN_STEP_OVER_SETTLING * time < step}
    settled = model.with_parameters(dict.fromkeys(quick, 0.0)) if quick else model
    if settled is model or reads_before(settled, data):
        return model, _as_it_is, ()
    settled = settled.with_options(frozen=tuple(dict.fromkeys((*model.frozen, *quick))))
    names = [name for name in model.states if name not in settled.states]
    shown = any(name in one.measured for name in names for one in data)
    late = 0.0 if shown else sum(quick.values())
    said = f"{', '.join(names)} follows at once: it settles in {max(quick.values()):.2g} s, a sample takes {step:.2g} s"
    return settled, functools.partial(_later, late) if late else _as_it_is, (said,)


def _as_it_is(record: ModelData) -> ModelData:
    return record


def _later(late: float, record: ModelData) -> ModelData:
    """Return a record whose inputs act so many s later."""
    return replace(record, acts=frozen((record.t if record.acts is None else record.acts) + late))


def restored(model: Model, given: Model) -> Model:
    """Return a fitted model with the tolerance of the given one, and its time constants that no record told of."""
    model = model.with_options(tolerance=given.tolerance)
    names = [n for n in model.plant.settling_times(given.parameters) if n in model.frozen and n not in given.frozen]
    left = tuple(n for n in model.frozen if n not in names)
    return model.with_parameters({n: given.parameters[n] for n in names}).with_options(frozen=left) if names else model


def reads_before(model: Model, data: Sequence[ModelData]) -> bool:
    """Tell whether outputs that follow at once were read before the inputs of their samples acted: then their changes
    from sample to sample go with those of the input of the sample before, beside those of the velocity.

    By instrumental variables [Ljung, System Identification, 2nd ed., sec. 7.6]: the velocity's noise is larger than its
    changes in a slow motion, which would be taken for the input's then.
    """
    names = [name for name in model.plant.algebraic(model.parameters) if all(name in one.measured for one in data)]
    return any(_goes_with_earlier(model, data, name) for name in names)


def _goes_with_earlier(model: Model, data: Sequence[ModelData], name: str) -> bool:
    rows = [_changes(model, one, name) for one in data if len(one) > MIN_COMPARED_SAMPLES]
    if not rows:
        return False
    shown, X, Z = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    good = np.isfinite(shown) & np.all(np.isfinite(X), axis=1)
    if not good.any():
        return False
    foretold = Z[good] @ np.linalg.lstsq(Z[good], X[good], rcond=None)[0]
    now, before, _ = np.abs(np.linalg.lstsq(foretold, shown[good], rcond=None)[0])
    return bool(before > now)


def _changes(model: Model, record: ModelData, name: str) -> tuple[Array, Array, Array]:
    """Return the changes (T - 2,) of an output from sample to sample; those (T - 2, 3) of the first input, of the same
    one sample before, and of the velocity; and their instruments (T - 2, 2 + len(INSTRUMENTS)): of the input both, and
    of the input low-passed, up to the sample before.
    """
    v, q = (record.measured.get(one) for one in (model.plant.velocity, model.plant.position))
    if v is None:
        v = np.zeros(len(record)) if q is None else np.gradient(q, record.t)
    moved = np.diff(record.u[:, 0])
    inputs = np.column_stack([moved[1:], moved[:-1]])
    keeps = np.exp(-1.0 / np.array(INSTRUMENTS))
    slow = [lfilter([1.0 - keep], [1.0, -keep], moved)[:-1] for keep in keeps]
    return (
        np.diff(record.measured[name])[1:],
        np.column_stack([inputs, np.diff(v)[1:]]),
        np.column_stack([inputs, *slow]),
    )


__all__ = ["reads_before", "restored", "with_settled"]
