"""Rivals that a user names and a diagnosis did not keep: fitted to the first records."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from signlin_ros.diagnosis.criteria import DEFAULT_CRITERIA
from signlin_ros.diagnosis.dataset import dataset_of
from signlin_ros.diagnosis.output_error import FitCache, FittedModel, OutputErrorEstimator, estimator_of
from signlin_ros.diagnosis.progress import Progress
from signlin_ros.diagnosis.rivals import rival
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import InputError, choices, suggest
from signlin_ros.experiment.common_scale import ALL_FORCES, NO_EFFECT, unscaled
from signlin_ros.experiment.setting import MAX_PLANNED_RIVALS, KnownLimits, known_rivals
from signlin_ros.experiment.sizes import is_sized
from signlin_ros.model import Model
from signlin_ros.records import ModelData

MIN_RIVALS = 3
"""Rivals below which the best of what was rejected is looked at, too."""
MAX_SIZED_KIN = 2
"""Laws with a size of interest that are looked at beside the others of their family."""


def open_names(content: Mapping[str, Any]) -> list[str]:
    """Return the rivals that a diagnosis (its JSON) names beside those it fitted: what ties with what it names, then
    other laws of its family, which were rejected for want of evidence, and laws that by the force alone would take
    most of what is missing away; as many as a plan takes.
    """
    named = list(content["ladder"][-1]["effects"])
    fitted = [tuple(r["effects"]) for r in content["rivals"]]
    swapped = list[tuple[str, ...]]()
    for entry in (e for e in content["ranking"] if e["effect"] in named):
        ties = list(entry["indistinguishable_from"])
        kin = [e["effect"] for e in content["ranking"] if e["status"] == "rejected" and _family(e["effect"])]
        ties += [name for name in kin if _family(name) == _family(entry["effect"])]
        swapped += [tuple(t if n == entry["effect"] else n for n in named) for t in ties]
    if len(named) == 1:
        swapped += [(name,) for name in _by_force(content)]
    if len(fitted) + len(swapped) < MIN_RIVALS and len(named) <= 1:
        others = [e["effect"] for e in content["ranking"] if e["status"] == "rejected" and e["parameters"]]
        swapped += [(name,) for name in others[:MIN_RIVALS]]
    new = [s for s in dict.fromkeys(swapped) if s not in fitted and len(set(s)) == len(s)]
    new = new[: max(MAX_PLANNED_RIVALS - len(fitted), 0)]
    beside = _sized_kin(content, [s[0] for s in (*fitted, *new) if len(s) == 1]) if len(named) <= 1 else []
    return [*("+".join(effects) for effects in new), *beside]


def _sized_kin(content: Mapping[str, Any], names: Sequence[str]) -> list[str]:
    """Return the laws that contain a simpler one, and have a size of interest, of the families of some rivals: the
    simpler one is not confirmed before they lose.
    """
    families = {_family(name) for name in names} - {""}
    there = [e["effect"] for e in content["ranking"] if e["status"] != "not_applicable"]
    sized = [n for n in there if is_sized(n) and EFFECTS[n].contains and _family(n) in families and n not in names]
    return sorted(sized, key=lambda n: len(EFFECTS[n].pars()))[:MAX_SIZED_KIN]


def _by_force(content: Mapping[str, Any]) -> list[str]:
    """Return the laws that would leave little of the force that the base model leaves, the least first."""
    before = content["ladder"][0].get("missing_force_percent")
    left = {e["effect"]: e.get("missing_force_percent") for e in content["ranking"]}
    told = {n: float(x) for n, x in left.items() if x is not None}
    most = float(np.sqrt(DEFAULT_CRITERIA.max_force_mse_left)) * before if before else 0.0
    return sorted((n for n, x in told.items() if x <= most), key=lambda n: told[n])


def _family(effect: str) -> str:
    return EFFECTS[effect].family if effect in EFFECTS else ""


def with_named(
    rivals: Sequence[KnownLimits],
    model: Model,
    records: Sequence[ModelData],
    names: Sequence[str],
    cancelled: Callable[[], bool] | None = None,
) -> list[KnownLimits]:
    """Return rivals with those of some names (effects joined by +), fitted to the records where they are not there yet.

    ``cancelled``: asked whether to stop, which raises `CancelledError`. Raises `InputError` for an effect that there is
    not, or that cannot be added.
    """
    known = {"+".join(r.effects) or NO_EFFECT for r in rivals}
    plain = list(dict.fromkeys(unscaled(name) for name in names))
    absent = [name for name in plain if name not in known]
    for effect in (e for name in absent if name != NO_EFFECT for e in name.split("+")):
        if effect not in EFFECTS:
            every = (NO_EFFECT, ALL_FORCES, *EFFECTS)
            raise InputError(
                f"--between: unknown effect {effect!r}; there are: {choices(every)}{suggest(effect, every)}"
            )
    if not absent:
        return list(rivals)
    made, watched = dataset_of(model, records), Progress(cancelled=cancelled) if cancelled else Progress()
    motion = estimator_of(made.training, made.validation, DEFAULT_CRITERIA, FitCache(), watched, jobs=1)
    found = [_fitted(motion, name) for name in absent]
    return [*rivals, *known_rivals([rival(f).to_json() for f in found])]


def _fitted(motion: OutputErrorEstimator, name: str) -> FittedModel:
    """Return the best fit of a rival; one of many local minima from the best of many starts."""
    if name == NO_EFFECT:
        return motion.base
    effects = name.split("+")
    best = motion.fitted(effects)
    options = motion.evolved(motion.base, effects) if len(effects) == 1 and EFFECTS[effects[0]].rugged else []
    return min([best, *options], key=lambda f: float(np.nansum(f.training_squares / motion.training.noise**2)))


__all__ = ["NO_EFFECT", "open_names", "with_named"]
