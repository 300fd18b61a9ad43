"""Linear models of non-smooth systems, and what their error says about missing physics.

    import signlin_ros as sl

    motor = sl.Model.load("dc_motor")
    A, B, c = sl.linearize(motor, [0.4, 20.0], [2.0])[:3]
    print(sl.diagnose("my_motor.yaml", "monday.csv", "tuesday.csv").sentence)

The names below are the public ones; everything is imported when it is first asked for. `signlin_ros.errors` holds the
exceptions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from signlin_ros.lazy import exports

if TYPE_CHECKING:
    from signlin_ros.api import (
        add,
        catalogue,
        check,
        compare,
        controller,
        diagnose,
        gains,
        observer,
        refine,
    )
    from signlin_ros.checks.finding import Finding
    from signlin_ros.diagnosis.compared import Comparison
    from signlin_ros.diagnosis.results import Diagnosis
    from signlin_ros.effects.base import Effect
    from signlin_ros.errors import (
        EffectError,
        InputError,
        MissingExtraError,
        ModelError,
        RecordError,
        SignlinError,
        SimulationError,
    )
    from signlin_ros.linearization import Linearization, Linearizer, linearize
    from signlin_ros.model import Model
    from signlin_ros.par import Par
    from signlin_ros.records import Record, read_record, write_record
    from signlin_ros.sign import sign_j
    from signlin_ros.simulation import Stepper, Trajectory, simulate

__version__ = "0.1.0"

_EXPORTS = {
    **dict.fromkeys(("add", "check", "compare", "controller", "diagnose"), "api"),
    **dict.fromkeys(("catalogue", "gains", "observer", "refine"), "api"),
    "Comparison": "signlin_ros.diagnosis.compared",
    "Diagnosis": "signlin_ros.diagnosis.results",
    "Effect": "signlin_ros.effects.base",
    "Finding": "signlin_ros.checks.finding",
    **dict.fromkeys(("Linearization", "Linearizer", "linearize"), "linearization"),
    "Model": "model",
    "Par": "par",
    **dict.fromkeys(("Record", "read_record", "write_record"), "records"),
    **dict.fromkeys(("Stepper", "Trajectory", "simulate"), "simulation"),
    "sign_j": "sign",
    **dict.fromkeys(("SignlinError", "InputError", "ModelError", "EffectError"), "errors"),
    **dict.fromkeys(("RecordError", "SimulationError", "MissingExtraError"), "errors"),
}
__getattr__, __dir__ = exports(__name__, _EXPORTS)

__all__ = [
    "Comparison",
    "Diagnosis",
    "Effect",
    "EffectError",
    "Finding",
    "InputError",
    "Linearization",
    "Linearizer",
    "MissingExtraError",
    "Model",
    "ModelError",
    "Par",
    "Record",
    "RecordError",
    "SignlinError",
    "SimulationError",
    "Stepper",
    "Trajectory",
    "add",
    "catalogue",
    "check",
    "compare",
    "controller",
    "diagnose",
    "gains",
    "linearize",
    "observer",
    "read_record",
    "refine",
    "sign_j",
    "simulate",
    "write_record",
]
