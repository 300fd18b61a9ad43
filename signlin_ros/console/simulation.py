"""A simulation as a record, as the mapping of schemas/simulate.json, and as text."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.console.tables import number, table
from signlin_ros.model import Model
from signlin_ros.records import ModelData, Record, Signal
from signlin_ros.simulation import Trajectory


def trajectory_record(model: Model, run: Trajectory, source: str) -> Record:
    """Return a run as a record: inputs, states, outputs, each name once."""
    names = dict.fromkeys((*run.inputs, *run.states, *run.outputs))
    return Record(run.t, {name: Signal(run[name], model.units[name]) for name in names}, source)


def simulate_content(
    model: Model, data: ModelData, run: Trajectory, kind: str, rtol: float, output: str
) -> dict[str, Any]:
    """Return the summary of a simulation, without its samples."""
    names = dict.fromkeys((*run.inputs, *run.states, *run.outputs))
    counts = Counter((surface, what) for _, surface, what in run.events)
    return {
        "output": output,
        "as": kind,
        "rtol": rtol,
        "samples": len(run.t),
        "start": float(run.t[0]),
        "end": float(run.t[-1]),
        "states": list(run.states),
        "inputs": list(run.inputs),
        "outputs": list(run.outputs),
        "initial_state": dict(zip(run.states, run.x[0].tolist(), strict=True)),
        "initial_state_from": "model" if data.x0 is None else "data",
        "final_state": dict(zip(run.states, run.x[-1].tolist(), strict=True)),
        "channels": {name: _channel(run[name], model.units[name]) for name in names},
        "events": [{"surface": s, "what": what, "count": n} for (s, what), n in sorted(counts.items())],
        "input_hold": "forward" if model.asks_hold else model.input_hold,
        "input_hold_from": "auto" if model.asks_hold else "model",
        "notes": list(data.notes),
    }


def _channel(values: NDArray[np.float64], unit: str) -> dict[str, Any]:
    rms = float(np.sqrt(np.mean(values**2)))
    return {"unit": unit, "low": float(np.min(values)), "high": float(np.max(values)), "rms": rms}


def simulate_text(content: dict[str, Any]) -> str:
    """Return the summary of a simulation as text."""
    origin = {"model": "the model's initial_state", "data": "the first row of the data"}
    rows = [["", "unit", "from", "to", "RMS"]]
    rows += [
        [name, c["unit"], *(number(c[key]) for key in ("low", "high", "rms"))]
        for name, c in content["channels"].items()
    ]
    events = [[e["surface"], e["what"], f"{e['count']}x"] for e in content["events"]]
    head = (
        f"{content['output']}: {content['samples']} samples, {content['start']:g} s to {content['end']:g} s,"
        f" as {content['as']}, from {origin[content['initial_state_from']]}"
    )
    if content["input_hold_from"] == "auto":
        head += "; inputs held from each sample to the next (input_hold: auto)"
    parts = [head, table(rows, right=[2, 3, 4])]
    return "\n\n".join(parts + (["surfaces\n" + table(events)] if events else []))


__all__ = ["simulate_content", "simulate_text", "trajectory_record"]
