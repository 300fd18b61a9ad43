"""The model with what was named, and its file."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from signlin_ros.diagnosis.findings import Findings
from signlin_ros.diagnosis.results import Diagnosis, ParameterEstimate
from signlin_ros.model import Model
from signlin_ros.model.numbers import numbers
from signlin_ros.records import ModelData


def rounded(model: Model, fitted: Mapping[str, ParameterEstimate]) -> Model:
    """Return a fitted model with its fitted values to six digits, and with its inputs held where nothing else shows."""
    if model.asks_hold and not model.plant.motion_is_imposed():
        model = model.with_options(input_hold="forward")
    own = numbers(model)
    return model.with_parameters({n: float(f"{own[n]:.6g}") for n in fitted if n in own})


def yaml_of(model: Model, fitted: Mapping[str, ParameterEstimate], findings: Findings) -> str:
    """Return the model file, with comments of where its values came from."""
    sources = ", ".join(dict.fromkeys(Path(source).name for source in findings.training))
    lines, own = [f"# Fitted to {sources}; what follows ± is the standard error."], numbers(model)
    fitted = {n: replace(p, value=own.get(n, p.value)) for n, p in fitted.items()}  # a servo's: of another criterion
    for line in model.to_yaml().splitlines():
        match = re.match(r"( *)([\w.]+):", line)
        key = match.group(2) if match else ""
        names = [n for n in fitted if (n.partition(".")[0] if "." in n else "parameters") == key]
        lines += [f"{match.group(1)}# {_origin(n, fitted[n], findings.base)}" for n in names if match]
        lines.append(line)
    return "\n".join(lines) + "\n"


def printed(result: Diagnosis, original: Model, output: str | None, records: Sequence[ModelData]) -> Diagnosis:
    """Return a diagnosis with its model as a file, the position only where needed; the reader's notes first."""
    model = result.model
    if model.with_position and not original.with_position:
        model = model.with_options(with_position=False)
    if output is not None:
        model = model.placed_in(Path(output).parent)
    done = (f"{record.source}: {note}" for record in records for note in record.notes)
    text = yaml_of(model, result.parameters, result.findings) if result.findings else model.to_yaml()
    return replace(result, yaml=text, notes=(*done, *result.notes))


def _origin(name: str, p: ParameterEstimate, base: Model) -> str:
    was = numbers(base).get(name)
    before = [f"was {was:g}"] if was is not None and not p.note.startswith("was ") else []
    return "; ".join([f"{name}: fitted, {p}", *before, *([p.note] if p.note else [])])


__all__ = ["printed", "rounded", "yaml_of"]
