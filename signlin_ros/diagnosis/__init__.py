"""How good a model is on measurements, where it fails, what it lacks.

    from signlin_ros.diagnosis import compare, diagnose, load_records

    model, data = load_records(Model.load("my_motor.yaml"), ["run.csv"])
    print(compare(model, data).to_json())
    print(diagnose(model, data).sentence)

Names below are loaded when first asked for.
"""

from __future__ import annotations

import importlib
from typing import Any

_EXPORTS = {
    "Comparison": "comparison",
    "Diagnosis": "results",
    "Missing": "missing",
    "Noise": "noise",
    "Region": "locate",
    "Score": "scores",
    "add": "verdict",
    "compare": "comparison",
    "diagnose": "verdict",
    "load_records": "data",
    "refine": "verdict",
    "noise_level": "noise",
    "residual_test": "whiteness",
}


def __getattr__(name: str) -> Any:
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_EXPORTS[name]}"), name)


def __dir__() -> list[str]:
    return sorted(_EXPORTS)
