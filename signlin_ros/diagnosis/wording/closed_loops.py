"""What records of a plant in a closed loop cannot tell, and which others would: no force is seen there, only motion."""

from __future__ import annotations

from collections.abc import Sequence

from signlin_ros.diagnosis.dataset import Dataset
from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.results import listed
from signlin_ros.diagnosis.verdict import Verdict
from signlin_ros.effects import find_effect
from signlin_ros.errors import joined

ASKED_CONDITIONS = {"mass": "of the load", "kp": "of the loop"}
"""Conditions that another record changes, and what goes with them."""
CALLED = {"mass": "mass", "kp": "gain"}
FAMILY = "dry friction"


def remarks(evidence: Evidence, verdict: Verdict) -> list[str]:
    """Return sentences on doubts that records of a closed loop leave; empty for other plants."""
    if not evidence.dataset.plant.closed_loop:
        return []
    beside, alike = _beside(evidence, verdict), same(evidence.dataset)
    found = [beside] if beside else []
    if alike:
        had = " and ".join(f"one {CALLED[n]} ({value:g}{_unit(evidence.dataset, n)})" for n, value in alike.items())
        what = " and ".join(ASKED_CONDITIONS[n] for n in alike)
        other = " and ".join(f"another {CALLED[n]}" for n in alike)
        found.append(
            f"all records have {had}: what goes with that {what} is not told from the rest; {other} would tell"
        )
    return found


def _beside(evidence: Evidence, verdict: Verdict) -> str:
    """Return which richer laws of friction the records cannot tell beside what is named."""
    if not verdict.names:
        return ""
    tried = evidence.cache.searched.get(verdict.names, set()) - set(verdict.names)
    names = sorted(n for n in tried if find_effect(n, "effects").family == FAMILY)
    if not names:
        return ""
    gain = f"none lowers the error on validation data by {evidence.criteria.min_t:g} standard errors"
    return f"beside {listed(verdict.names)} these records cannot tell {listed(names)}: {gain}"


def experiments(evidence: Evidence) -> list[str]:
    """Return which records would tell more."""
    alike = same(evidence.dataset) if evidence.dataset.plant.closed_loop else {}
    what = {"mass": "friction that follows the load from friction that does not", "kp": "the motor from its loop"}
    return [
        f"to tell {what[n]}: records with another {CALLED[n]} than {x:g}{_unit(evidence.dataset, n)}"
        for n, x in alike.items()
    ]


def absolute(before: float, after: float, unit: str, written: Sequence[str]) -> str:
    """Return what is said where the values in the file are those of least absolute errors: mean ones of both fits, and
    what of the laws is written.
    """
    why = "free runs err rarely and then by much, as where a servo sticks elsewhere than its model does"
    values = f"the file has the values of the least absolute error, {joined(list(written))}"
    errs = f"with them the model errs by {after:.3g} {unit} on average, with those of the tables by {before:.3g}"
    return f"{why}: {values}; {errs}"


def same(dataset: Dataset) -> dict[str, float]:
    """Return the conditions that all records have alike, by name."""
    found, model = dict[str, float](), dataset.model
    for name in ASKED_CONDITIONS:
        values = {record.conditions.get(name, model.parameters[name]) for record in dataset.records}
        if len(values) == 1:
            found[name] = values.pop()
    return found


def _unit(dataset: Dataset, name: str) -> str:
    return f" {dataset.plant.pars()[name].unit}".removesuffix(" -")


__all__ = ["experiments", "remarks", "same"]
