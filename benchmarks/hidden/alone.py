"""What either estimate says by itself: of the force alone (equation error), of the motion alone (output error)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

ESTIMATES = ("both", "force", "motion")


def answer(folder: Path, by: str) -> dict[str, Any]:
    """Return what one estimate says of a record's folder, as the JSON of `signlin diagnose`, as far as it is scored."""
    from signlin_ros.diagnosis import load_records
    from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
    from signlin_ros.diagnosis.dataset import dataset_of
    from signlin_ros.model import Model

    paths = [str(folder / f"{name}.csv") for name in ("estimation", "validation")]
    model, (estimation, validation) = load_records(Model.load(folder / "model.yaml"), paths)
    data = dataset_of(model, estimation, validation)
    return _by_force(data, DEFAULT_CRITERIA) if by == "force" else _by_motion(data, DEFAULT_CRITERIA)


def _by_motion(data: Any, criteria: Any) -> dict[str, Any]:
    from signlin_ros.diagnosis.evidence import Evidence
    from signlin_ros.diagnosis.output_error import FitCache, estimator_of
    from signlin_ros.diagnosis.progress import Progress
    from signlin_ros.diagnosis.pruning import without_idle, without_untold
    from signlin_ros.diagnosis.selection import select_model
    from signlin_ros.diagnosis.summary import summary_of
    from signlin_ros.diagnosis.verdict import verdict_of
    from signlin_ros.threads import one_thread

    def asked() -> dict[str, Any]:
        motion = estimator_of(data.training, data.validation, criteria, FitCache(), Progress(), 1)
        evidence = Evidence(data, motion, None)
        verdict = without_untold(evidence, verdict_of(evidence, select_model(evidence)))
        return dict(summary_of(evidence, without_idle(evidence, verdict)).to_json())

    return dict(one_thread(asked)())


def _by_force(data: Any, criteria: Any) -> dict[str, Any]:
    """Return the laws that the missing force shows; unexplained is what none but a flexible curve takes away."""
    from signlin_ros.diagnosis.equation_error.estimate import estimate_equation_error

    found = estimate_equation_error(data.training, data.validation, criteria)
    names = found.effects
    entries = [
        {
            "effect": n,
            "status": "confirmed",
            "parameters": {},
            "indistinguishable_from": list(found.ties[n]),
        }
        for n in names
    ]
    verdict = "unexplained" if found.flexible.visible else "missing" if names else "adequate"
    row: dict[str, Any] = {"effects": list(names), "validation": {}}
    return {"verdict": verdict, "ranking": entries, "ladder": [row], "base": {"validation": {}}}


__all__ = ["ESTIMATES", "answer"]
