"""The evidence picture of a named effect beside its nearest rival, as numbers for the page."""

from __future__ import annotations

from typing import Any

import numpy as np

from signlin_ros.diagnosis.curves import Band
from signlin_ros.diagnosis.evidence import Explanation, evidence
from signlin_ros.diagnosis.motion import Fitted
from signlin_ros.diagnosis.results import Diagnosis
from signlin_ros.diagnosis.told import Findings
from signlin_ros.workbench.arrays import encoded

DOTS = 1500
"""So many samples of what the motion lacks are shown as dots."""


def pictures(result: Diagnosis) -> dict[str, Any]:
    """Return the picture of each effect that a diagnosis names, and of the best one that it refuses; by name."""
    if result.findings is None:
        return {}
    found = {entry.effect: _shown(result.findings, entry.effect) for entry in result.missing}
    if not found:
        found = _nearest(result.findings)
    return {name: one for name, one in found.items() if one}


def _nearest(findings: Findings) -> dict[str, Any]:
    """Return the picture of the best single effect that has one, where none is named."""
    single = (f for f in findings.agreed.tried if len(f.effects) == 1)
    for fitted in sorted(single, key=lambda f: f.level):
        picture = _shown(findings, fitted.effects[0], fitted)
        if picture is not None:
            return {fitted.effects[0]: picture}
    return {}


def _shown(findings: Findings, effect: str, within: Fitted | None = None) -> dict[str, Any] | None:
    """Return one picture; None where there is nothing to show."""
    e = evidence(findings, effect, within)
    if e is None:
        return None
    one_in = max(1, e.place.x.size // DOTS)
    rival = _explanation(e.rival) if e.rival is not None else None
    return {
        "quantity": e.quantity,
        "unit": e.unit,
        "over": e.place.name,
        "over_unit": e.place.unit,
        "sources": list(e.sources),
        "x": encoded(e.place.x[::one_in]),
        "dots": encoded(e.named.measured[::one_in]),
        "named": _explanation(e.named),
        "rival": rival,
        "rival_dots": encoded(e.rival.measured[::one_in]) if e.rival is not None else None,
    }


def _explanation(x: Explanation) -> dict[str, Any]:
    return {
        "effect": x.effect,
        "parameters": {name: str(value) for name, value in x.parameters.items()},
        "found": [_band(b) for b in x.found],
        "curve": [_band(b) for b in x.curve],
        "left": _left(x),
    }


def _band(b: Band) -> dict[str, Any]:
    return {"at": encoded(b.at), "mean": encoded(b.mean), "two_errors": encoded(b.two_errors)}


def _left(x: Explanation) -> float:
    """Return the RMS of what the explanation leaves."""
    return float(np.sqrt(np.nanmean((x.measured - x.computed) ** 2)))


__all__ = ["pictures"]
