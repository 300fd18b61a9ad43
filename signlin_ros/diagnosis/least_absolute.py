"""The values of a proposal in a closed loop by the least absolute error of its free runs, where that is more likely.

A servo that sticks elsewhere than its model errs rarely and by much there: least squares bend all values for these few,
and what is predicted under another gain or load is worse for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from signlin_ros.diagnosis.proposal import rounded, yaml_of
from signlin_ros.diagnosis.results import Diagnosis
from signlin_ros.diagnosis.wording import closed_loops
from signlin_ros.fitting.absolute import heavy_tailed, least_absolute
from signlin_ros.fitting.candidate import candidate
from signlin_ros.fitting.following import follow_records
from signlin_ros.fitting.prepare import prepared
from signlin_ros.model import Model
from signlin_ros.model.numbers import numbers
from signlin_ros.records import ModelData


def by_absolute_error(found: Diagnosis, model: Model, data: Sequence[ModelData]) -> Diagnosis:
    """Return a diagnosis of a plant in a closed loop whose file has the values of least absolute errors, if free runs
    of the proposal err as Laplace's distribution has it; else, and where records have values of their own, as it is.
    Tables and standard errors stay those of least squares, and a note tells of both.
    """
    if not model.plant.closed_loop or not found.ladder[-1].effects or model.per_record or found.findings is None:
        return found
    problem, _ = prepared(model, data, data)
    keys = tuple(k for k in found.model.effects if k not in problem.base.effects)
    proposal = problem.base
    for key in keys:
        use = found.model.effects[key]
        proposal = proposal.with_effect(use.type, key, **use.parameters)
    c = candidate(problem, proposal, keys, {})
    theta, gains = np.clip(c.start(numbers(found.model)), *c.bounds), problem.observer_gains[-1]
    before = follow_records(problem, replace(c, starts={}), theta, gains, False)
    if before is None or not heavy_tailed(before[0]):
        return found
    after = follow_records(problem, c, theta := least_absolute(problem, c, theta), gains, False)
    if after is None:
        return found
    values = {n: x for n, x in c.named(theta).items() if n in found.parameters}
    parameters = {n: replace(p, value=values.get(n, p.value)) for n, p in found.parameters.items()}
    new = rounded(found.model.with_parameters(values), parameters)
    k = problem.channels.index(model.plant.position)
    first, last = (float(np.nanmean(np.abs(np.concatenate(e[0])[:, k]))) for e in (before, after))
    written = [f"{n} {p}" for n, p in parameters.items() if n.partition(".")[0] in keys]
    note = closed_loops.absolute(first, last, problem.unit_of(model.plant.position), written)
    text = yaml_of(new, parameters, found.findings)
    return replace(found, model=new, yaml=text, notes=(*found.notes, note))


__all__ = ["by_absolute_error"]
