"""What a model lacks, learned from its records: inverse dynamics, `signlin_ros.learning.curve`, then the effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.inverse import Efforts
from signlin_ros.diagnosis.comparison import compare_efforts
from signlin_ros.diagnosis.dataset import dataset_of
from signlin_ros.diagnosis.evidence import refitted_evidence
from signlin_ros.diagnosis.rows import first_rows, row
from signlin_ros.effects.learned_force import LEARNED_OVER
from signlin_ros.errors import InputError
from signlin_ros.fitting.prepare import held_out
from signlin_ros.follow.data import as_list
from signlin_ros.learning.curve import Learned, learn
from signlin_ros.model import Model
from signlin_ros.records import ModelData

Array = NDArray[np.float64]
DIGITS = 6
"""Significant digits of what is written into a model."""


def learn_missing(
    model: Model,
    data: ModelData | Sequence[ModelData],
    over: str,
    shape: str = "free",
    cutoff: float | None = None,
) -> Learned:
    """Learn the force that a model lacks on records, as a curve over one coordinate or two.

    The missing force is that of the diagnosis (`signlin_ros.comparison.force_segment`); where the machine stands it is
    not known.

    Parameters
    ----------
    over : ``speed``, ``position``, ``load``, or two of them: ``speed, load``.
    shape : one of `signlin_ros.learning.curve.SHAPES`.
    cutoff : of the low-pass in Hz; by default that of the diagnosis.

    Raises
    ------
    InputError
        The effort or a coordinate is not known from these records.
    """
    over = ", ".join(word.strip() for word in over.split(","))
    if over not in LEARNED_OVER:
        raise InputError(f"over: found {over!r}; allowed: {'; '.join(LEARNED_OVER)}")
    efforts = compare_efforts(model, data, cutoff)
    if efforts is None:
        raise InputError("the effort and the motion are not both known from these records, or they are too short")
    coordinates = {word: _along(efforts, model, word) for word in over.split(", ")}
    force = efforts.missing(model)
    return learn(coordinates, force, np.ones_like(force), shape=shape)


def with_learned(model: Model, learned: Learned, key: str | None = None) -> Model:
    """Return a model with what was learned as its effect `learned_force`."""
    parameters = {name: _rounded(value) for name, value in learned.parameters().items()}
    return model.with_effect("learned_force", key, **parameters)


def _rounded(value: object) -> object:
    if isinstance(value, list):
        return [_rounded(one) for one in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def _along(efforts: Efforts, model: Model, word: str) -> Array:
    """Return a coordinate (K,) at the samples of the efforts."""
    if word == "load":
        if model.plant.motion_is_imposed():
            raise InputError(f"over: load: the plant {model.plant.name} is moved, nothing drives it")
        return efforts.measured
    name = {"speed": model.plant.velocity, "position": model.plant.position}[word]
    found = efforts.along(model, name)
    if found is None:
        raise InputError(f"over: {word}: the {name} is neither measured nor a state of the model")
    return found


def add_learned(
    model: Model,
    data: ModelData | Sequence[ModelData],
    validation: ModelData | Sequence[ModelData] | None = None,
    over: str = "speed",
) -> tuple[Model, dict[str, Any]]:
    """Return the model with a learned force, and before and after in the form of ``schemas/diagnose.json``.

    Without validation the last third of every record is held out. The base parameters stay as they are; the first rows
    are those of every verb all the same.
    """
    known, unseen = (as_list(data), as_list(validation)) if validation is not None else held_out(as_list(data))
    w = refitted_evidence(dataset_of(model, known, unseen))
    made, model = w.dataset, model.with_options(input_hold=w.dataset.model.input_hold)
    learned = learn_missing(model, known, over)
    new = with_learned(model, learned)
    notes = dict.fromkeys(f"{record.source}: {note}" for record in (*known, *unseen) for note in record.notes)
    after = w.output_error.without_fit(new, ("learned_force",))
    first, last = first_rows(w), row(w, after, w.force_mse_as_written(after)).to_json()
    given, base = first.given.to_json(), first.refitted.to_json()
    unit = made.training.shown(new.unit_of("F"))
    entry = _entry(new, learned, unit, given["validation"], last["validation"])
    return new, {
        "verdict": "missing" if entry["status"] == "confirmed" else "unexplained",
        "sentence": f"Learned: {entry['why']}. Beyond what the records visited it goes straight on.",
        "given": given,
        "base": {"parameters": {}, "validation": base["validation"]},
        "ranking": [entry],
        "ladder": [base, last],
        "parameters": {f"learned_force.{n}": p for n, p in entry["parameters"].items()},
        "model": new.to_yaml(),
        "range": _range(learned),
        "noise": made.noise,
        "experiments": [],
        "notes": [*notes, *made.training.notes, *made.validation.notes],
        "horizon": first.horizon,
    }


def _entry(new: Model, learned: Learned, unit: str, before: dict[str, Any], after: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON of the effect; ``unit`` of the force; before and after: SCORES on validation data."""
    better = learned.explained > 0 and all(_error(after[n]) < _error(before[n]) for n in before if n != "score")
    where = learned.over.replace(", ", " and the ")
    told = (
        f"a curve over the {where} takes {100 * max(learned.explained, 0.0):.0f} % of the square of the missing force"
        f" on blocks that it has not seen: {learned.before:.3g} {unit} become {learned.unseen:.3g} {unit} (RMS)"
    )
    return {
        "effect": "learned_force",
        "status": "confirmed" if better else "rejected",
        "parameters": _estimates(new, unit),
        "validation": after,
        "indistinguishable_from": [],
        "why": told if better else f"{told}, and the motion on validation data is not predicted better",
    }


def _error(score: Mapping[str, Any]) -> float:
    return np.inf if score["rmse"] is None else float(score["rmse"])


def _estimates(model: Model, unit: str) -> dict[str, dict[str, Any]]:
    """Return the values and the jump as the contract's PARAMETERS; knots are chosen, not estimated."""
    given = model.effects["learned_force"].parameters
    shown = {n: v for n, v in given.items() if n.startswith("values[") or (n == "jump" and v)}
    return {n: {"value": v, "std": None, "unit": unit, "note": ""} for n, v in shown.items()}


def _range(learned: Learned) -> dict[str, list[float]]:
    names = learned.over.split(", ")
    return {n: [float(k[0]), float(k[-1])] for n, k in zip(names, learned.knots, strict=True)}


__all__ = ["add_learned", "learn_missing", "with_learned"]
