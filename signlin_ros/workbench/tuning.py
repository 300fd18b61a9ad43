"""A model with its parameters moved by hand: what it does, what it leaves, and A_k, B_k and poles at a time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import SignlinError
from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.simulation import simulate
from signlin_ros.workbench import arrays

Array = NDArray[np.float64]

SLIDER_REACH = 3.0
"""A slider goes from a third of a value to three times it, within the declared bounds."""


def parameters(model: Model) -> list[dict[str, Any]]:
    """Return every number of a model with its unit, sentence, bounds and the range of its slider."""
    return [
        _parameter(name.removeprefix("parameters.").removeprefix("effects."), par, model)
        for name, par in model.par_declarations().items()
        if not par.structural
    ]


def _parameter(name: str, par: Any, model: Model) -> dict[str, Any]:
    value = model.value(name)
    size = abs(value) if value else abs(par.nominal) or 1.0
    low, high = (size / SLIDER_REACH, size * SLIDER_REACH) if value > 0 else (-SLIDER_REACH * size, SLIDER_REACH * size)
    low = max(low if value else 0.0 if par.low >= 0 else low, par.low)
    bounds = {k: v if math.isfinite(v) else None for k, v in (("low", par.low), ("high", par.high))}
    return {
        "name": name,
        "value": value,
        "unit": par.unit,
        "doc": par.doc,
        "range": par.range_text(),
        "from": low,
        "to": min(high, par.high),
        **bounds,
    }


def changed(model: Model, values: Mapping[str, float]) -> Model:
    """Return a model with other numbers; values beyond their bounds are refused by the model."""
    return model.with_parameters({name: float(value) for name, value in values.items()}) if values else model


class TuningBench:
    """A model beside one record, ready to be simulated again and again."""

    def __init__(self, model: Model, record: ModelData) -> None:
        self.model, self.record = model, record
        self.names = [n for n in dict.fromkeys((*model.states, *model.outputs)) if n in record.measured]
        self.start = _start(model, record)

    def answer(
        self, values: Mapping[str, float], at: float | None, span: Sequence[float | None], points: int
    ) -> dict[str, Any]:
        """Return plots by channel, RMS of what is left, and the linear model at the time ``at`` (s)."""
        model, r = changed(self.model, values), self.record
        run = simulate(model, r.t, r.u, self.start, rtol=1e-5)
        plots, left = [], {}
        for name in self.names:
            curves = {"measured": r.measured[name], "simulated": run[name]}
            curves["residual"] = curves["measured"] - curves["simulated"]
            left[name] = float(np.sqrt(np.nanmean(curves["residual"] ** 2)))
            plots.append({"name": name, "unit": r.units[name], **arrays.picture(r.t, curves, span, points)})
        k = r.t.size // 2 if at is None else int(np.clip(np.searchsorted(r.t, at), 0, r.t.size - 1))
        linear = _linear(model, run.x[k], r.u[k])
        return {"plots": plots, "rms": left, "at": float(r.t[k]), "linear": linear, "span": _ends(r.t)}


def _ends(t: Array) -> list[float]:
    return [float(t[0]), float(t[-1])]


def _start(model: Model, record: ModelData) -> Array:
    """Return the state at the first sample: what is measured of it, the model's own value for the rest."""
    first = np.array(model.x0, dtype=float)
    for i, name in enumerate(model.states):
        values = record.measured.get(name)
        if values is not None and np.isfinite(values[0]):
            first[i] = values[0]
    return np.asarray(model.true_states(first))


def _linear(model: Model, x: Array, u: Array) -> dict[str, Any]:
    try:
        found = Linearizer(model)(x, u)
    except SignlinError as error:
        return {"why": str(error)}
    poles = np.linalg.eigvals(found.A)
    return {
        "A": found.A.tolist(),
        "B": found.B.tolist(),
        "c": found.c.tolist(),
        "states": list(model.states),
        "inputs": list(model.inputs),
        "x": found.x.tolist(),
        "units": {name: model.units[name] for name in model.states},
        "poles": [[float(p.real), float(p.imag)] for p in poles],
        "in_valid_range": bool(found.in_valid_range),
    }


__all__ = ["TuningBench", "changed", "parameters"]
