"""How good a model is on measurements, where it fails, what it lacks.

    from signlin_ros.diagnosis import compare, diagnose, load_records

    model, data = load_records(Model.load("my_motor.yaml"), ["run.csv"])
    print(compare(model, data).to_json())
    print(diagnose(model, data).sentence)

Names below are loaded when first asked for.
"""

from __future__ import annotations

from signlin_ros.lazy import exports

_EXPORTS = {
    "Comparison": "comparison",
    "Diagnosis": "results",
    "Missing": "missing",
    "Noise": "noise",
    "Region": "locate",
    "Score": "scores",
    "add": "verbs",
    "compare": "comparison",
    "diagnose": "verbs",
    "load_records": "data",
    "refine": "verbs",
    "noise_level": "noise",
    "residual_test": "whiteness",
}

__getattr__, __dir__ = exports(__name__, _EXPORTS)
