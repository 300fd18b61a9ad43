"""The model with what was named, and its file."""

from __future__ import annotations

import re
from pathlib import Path

from signlin_ros.diagnosis.findings import Findings
from signlin_ros.diagnosis.parameters import estimates, given
from signlin_ros.diagnosis.results import Estimate
from signlin_ros.model import Model


def proposal(f: Findings) -> Model:
    """Return the base model with the named effects and all fitted values, sensors included."""
    found = f.final.ranked.fit
    model, values = found.fitted(), found.parameters()
    model = model.with_parameters({n: float(f"{model.value(n):.6g}") for n in values if not n.startswith("sensor_")})
    for name in f.final.ranked.sensors:
        kind, _, channel = name.partition(".")
        model = model.with_effect(kind, None, **{channel: float(f"{values[name]:.6g}")})
    return model


def yaml_of(model: Model, f: Findings) -> str:
    """Return the model file, with comments of where the fitted values came from."""
    found = f.final.ranked.fit
    fitted = estimates(found, [c.name for c in found.candidate.coordinates], f)
    sources = ", ".join(dict.fromkeys(Path(s.source).name for s in f.problem.segments))
    lines = [f"# Fitted to {sources}; what follows ± is the standard error."]
    for line in model.to_yaml().splitlines():
        match = re.match(r"( *)([\w.]+):", line)
        key = match.group(2) if match else ""
        names = [n for n in fitted if (n.partition(".")[0] if "." in n else "parameters") == key]
        lines += [f"{match.group(1)}# {_origin(n, fitted[n], f.problem.base)}" for n in names if match]
        lines.append(line)
    return "\n".join(lines) + "\n"


def _origin(name: str, p: Estimate, base: Model) -> str:
    was = given(base, name)
    before = [f"was {was:g}"] if was is not None and not p.note.startswith("was ") else []
    return "; ".join([f"{name}: fitted, {p}", *before, *([p.note] if p.note else [])])


__all__ = ["proposal", "yaml_of"]
