"""What became of the rivals of a planned experiment, in words."""

from __future__ import annotations

from collections.abc import Sequence

from signlin_ros.diagnosis.discrimination import BOUND_SHARES, Doubts, RefittedRival, loses
from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.results import listed
from signlin_ros.digits import with_error
from signlin_ros.effects import EFFECTS, kin_of
from signlin_ros.errors import joined
from signlin_ros.model.numbers import declared
from signlin_ros.recording.trace import resolve_unit


def told(evidence: Evidence, rivals: Sequence[RefittedRival], final: FittedModel, doubts: Doubts) -> str:
    """Return the sentences on the rivals; empty where there are none, or nothing is named."""
    if not rivals or not final.effects:
        return ""
    ties, parts = doubts.undecided, list[str]()
    if doubts.together:
        parts.append(_together(rivals, doubts.together))
    if doubts.near:
        names = listed(["+".join(r.effects) or "nothing" for r in doubts.near])
        parts.append(f"Not confirmed: what it leaves is more than noise, and no small part of what {names} would leave")
    if ties:
        names = listed(["+".join(r.effects) or "nothing" for r in ties])
        parts.append(f"Not decided: {names}, refitted from the values of the plan, cannot be told from it")
    others = [r for r in rivals if r not in ties and r.effects and set(r.effects) != set(final.effects)]
    lost = [r for r in others if loses(evidence, r.least, final)]
    bounds = [b if _holds(r, final) and (b := _bound(evidence, r, final)) else "" for r in lost]
    whole, sizes = [r for r, b in zip(lost, bounds, strict=True) if not b], [b for b in bounds if b]
    if whole:
        least = min(evidence.output_error.t_ratio(r.least, final) for r in whole)
        names, by = listed(["+".join(r.effects) for r in whole]), f"by {least:.1f} standard errors"
        what = f"lose {by} or more" if len(whole) > 1 else f"loses {by}"
        parts.append(f"Refitted from the values of the plan {names} {what}")
    parts += [f"Excluded is {joined(sizes)}"] if sizes else []
    return " ".join(f"{part}." for part in parts)


def _together(rivals: Sequence[RefittedRival], names: Sequence[str]) -> str:
    """Return what is needed beside the rivals, in words, and the plan that has it beside each of them."""
    known = {n for r in rivals for n in r.effects}
    more = [n for n in names if n not in known]
    if not more or len(more) == len(names):
        return f"None of the rivals of the plan is enough: {listed(names)} would be needed together"
    pairs = ",".join("+".join([*r.effects, *more]) for r in rivals if r.effects and not set(more) & set(r.effects))
    again = f"to plan with {listed(more)} beside every rival, signlin experiment --between {pairs}"
    return f"None of the rivals of the plan is enough: {listed(more)} would be needed as well; {again}"


def _holds(r: RefittedRival, final: FittedModel) -> bool:
    """Tell whether a rival has a size and is richer than what is named: of its family, or a law that contains it."""
    if len(r.effects) != 1 or len(final.effects) != 1 or not r.size:
        return False
    (rival,), (named,) = r.effects, final.effects
    contains = rival in kin_of(named) or named in EFFECTS[rival].contains
    return contains and r.best.n_parameters > final.n_parameters


def _bound(evidence: Evidence, r: RefittedRival, final: FittedModel) -> str:
    """Return the smallest size of what a lost rival adds that is excluded, in words; empty where none is."""
    smallest = ""
    for share in reversed(BOUND_SHARES):
        value, f = r.at(share)
        if f is None or not loses(evidence, f, final):
            break
        key, _, name = r.size.rpartition(".")
        unit = evidence.dataset.training.shown(resolve_unit(declared(f.model)[r.size].unit, f.model.plant, False))
        size = f"{with_error(value, 0.2 * value)[0]} {unit}".rstrip()
        smallest = f"{listed([key])} with {name} of {size} or {'less' if r.stiff else 'more'}"
    return smallest


__all__ = ["told"]
