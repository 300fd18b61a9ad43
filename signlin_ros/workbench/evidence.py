"""The evidence picture of a named effect beside its nearest rival, as numbers for the page."""

from __future__ import annotations

from typing import Any

import numpy as np

from signlin_ros.comparison.bands import Band
from signlin_ros.comparison.waves import said, waves_of
from signlin_ros.diagnosis.effect_evidence import EffectEvidence, Explanation
from signlin_ros.diagnosis.evidence import changes_effort
from signlin_ros.diagnosis.results import Diagnosis
from signlin_ros.effects import find_effect
from signlin_ros.recording.trace import resolve_unit
from signlin_ros.workbench.arrays import encoded

MAX_SHOWN_PARAMETERS = 6
"""Effects of more parameters are told by their values in words, or by the table of all effects."""
DOTS = 1500
"""So many samples of what the motion lacks are shown as dots."""


def shown(result: Diagnosis, asked: str = "") -> dict[str, Any]:
    """Return the evidence of effects that were found, or asked for, as JSON: pictures, values, what has no picture.

    ``effect_evidence`` by effect; ``values``: effect -> parameter -> text; ``unseen``: effect -> why there is none.
    """
    found = pictures(result)
    named = list(dict.fromkeys([*(entry.effect for entry in result.missing), *([asked] if asked else [])]))
    return {
        "evidence": found,
        "values": {effect: _values(result, effect) for effect in named},
        "unseen": {effect: _why(effect) for effect in named if effect not in found},
    }


def _values(result: Diagnosis, effect: str) -> dict[str, str]:
    """Return the parameters of an effect as they were fitted, with their errors and units."""
    summary = _waves(result, effect)
    if summary:
        return {"": summary}
    keys = [key for key, use in result.model.effects.items() if use.type == effect]
    parts = ((name.partition("."), estimate) for name, estimate in result.parameters.items())
    return {own: str(estimate) for (key, _, own), estimate in parts if key in keys}


def _waves(result: Diagnosis, effect: str) -> str:
    """Return the waves of an effect in words: ``12 per turn, 0.0045 N·m``; empty where it does not repeat."""
    waves = waves_of(result.model, effect)
    if not waves or result.findings is None:
        return ""
    found = result.findings
    force, position = (found.shown(resolve_unit(one, found.base.plant)) for one in ("F", "Q"))
    return said(waves, position == "rad", force)


def _why(effect: str) -> str:
    """Return why there is no picture of an effect."""
    if changes_effort(find_effect(effect, "effects")):
        return "It changes the input, and is no force over speed or position: there is no picture of it."
    return (
        "The part of the records that no fit sees is too short for a picture of it: a second record, or a longer one,"
        " gives one."
    )


def pictures(result: Diagnosis) -> dict[str, Any]:
    """Return the picture of each effect that a diagnosis names, or of the best one that it refuses; by name."""
    found = result.findings.effects if result.findings else {}
    return {name: _shown(one) for name, one in found.items()}


def _shown(e: EffectEvidence) -> dict[str, Any]:
    """Return one picture."""
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
        "spectrum": _spectrum(e),
        "rival_dots": encoded(e.rival.measured[::one_in]) if e.rival is not None else None,
    }


def _spectrum(e: EffectEvidence) -> dict[str, Any] | None:
    s = e.spectrum
    if s is None:
        return None
    return {"orders": encoded(s.orders), "missing": encoded(s.missing), "left": encoded(s.left)}


def _explanation(x: Explanation) -> dict[str, Any]:
    return {
        "effect": x.effect,
        "parameters": {name: str(value) for name, value in x.parameters.items()}
        if len(x.parameters) <= MAX_SHOWN_PARAMETERS
        else {},
        "found": [_band(b) for b in x.found],
        "curve": [_band(b) for b in x.curve],
        "left": _left(x),
    }


def _band(b: Band) -> dict[str, Any]:
    return {"at": encoded(b.at), "mean": encoded(b.mean), "two_errors": encoded(b.two_errors)}


def _left(x: Explanation) -> float:
    """Return the RMS of what the explanation leaves."""
    return float(np.sqrt(np.nanmean((x.measured - x.computed) ** 2)))


__all__ = ["shown"]
