"""What pages, pictures and the model file show of a diagnosis beside its tables: values, and no solver."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from operator import attrgetter

from signlin_ros.diagnosis.effect_evidence import EffectEvidence, effect_evidence
from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.output_error.fitted import held
from signlin_ros.diagnosis.results import ParameterEstimate
from signlin_ros.diagnosis.verdict import Verdict
from signlin_ros.model import Model
from signlin_ros.recording.trace import rotary_unit


@dataclass(frozen=True, eq=False)
class Findings:
    """``base``: the model as given, with its position as a state where that is measured, and ``refitted``; sources of
    ``training`` and ``validation`` data; ``units`` of signals, in those of the records where they are ``rotary``.

    ``held``: parameters that no fit moved; ``reversed``: the signal whose sign seems wrong; ``effects``: the evidence
    of every effect that is named and shows as a force, or, where none is named, of the best that does; ``nearest``: the
    best single effect that was fitted, whether or not it has any.
    """

    base: Model
    refitted: Model
    training: tuple[str, ...]
    validation: tuple[str, ...]
    units: Mapping[str, str]
    rotary: bool
    held: Mapping[str, ParameterEstimate]
    reversed: str = ""
    effects: Mapping[str, EffectEvidence] = field(default_factory=dict)
    nearest: str = ""

    def shown(self, unit: str) -> str:
        """Return a unit of the model as the records have it."""
        return rotary_unit(unit) if self.rotary else unit


def findings_of(evidence: Evidence, verdict: Verdict, model: Model, told: Collection[str]) -> Findings:
    """Return the values that pages show of a verdict; ``model``: as proposed, ``told``: its parameters in tables."""
    problem, unseen = evidence.dataset.training, evidence.dataset.validation
    best = nearest(evidence)
    return Findings(
        base=problem.base,
        refitted=verdict.base.model,
        training=tuple(s.source for s in problem.segments),
        validation=tuple(s.source for s in unseen.segments),
        units=problem.units,
        rotary=problem.rotary,
        held=held(problem, model, told),
        reversed=verdict.reversed,
        effects=_named(evidence, verdict) or _best(evidence, verdict),
        nearest=best.effects[0] if best else "",
    )


def nearest(evidence: Evidence) -> FittedModel | None:
    """Return the best single effect that was fitted, named or not; None where none was."""
    return min(evidence.single_effect_fits, key=attrgetter("log_mse"), default=None)


def _named(evidence: Evidence, verdict: Verdict) -> dict[str, EffectEvidence]:
    """Return the evidence of every effect of the selected model."""
    found = {n: effect_evidence(evidence, verdict.final, n) for n in verdict.names}
    return {n: one for n, one in found.items() if one is not None}


def _best(evidence: Evidence, verdict: Verdict) -> dict[str, EffectEvidence]:
    """Return the evidence of the best single effect that shows as a force, where none is named."""
    for f in () if verdict.names else sorted(evidence.single_effect_fits, key=attrgetter("log_mse")):
        found = effect_evidence(evidence, f, f.effects[0])
        if found is not None:
            return {f.effects[0]: found}
    return {}


__all__ = ["Findings", "findings_of", "nearest"]
