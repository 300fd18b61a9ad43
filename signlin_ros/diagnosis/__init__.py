"""How good a model is on measurements, where it fails, what it lacks.

from signlin_ros.diagnosis import compare, diagnose, load_records

model, data = load_records(Model.load("my_motor.yaml"), ["run.csv"])
print(compare(model, data).to_json())
print(diagnose(model, data).sentence)
"""

from __future__ import annotations

from signlin_ros.lazy import exports

_EXPORTS = {
    "Comparison": "compared",
    "Diagnosis": "results",
    "Missing": "signlin_ros.comparison.missing",
    "Noise": "signlin_ros.noise",
    "Region": "signlin_ros.comparison.locate",
    "Score": "signlin_ros.comparison.scores",
    "add": "verbs",
    "compare": "comparison",
    "diagnose": "verbs",
    "load_records": "signlin_ros.follow.data",
    "refine": "verbs",
    "noise_level": "signlin_ros.noise",
    "residual_test": "signlin_ros.comparison.residuals",
}

__getattr__, __dir__ = exports(__name__, _EXPORTS)
