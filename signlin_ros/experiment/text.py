"""What a plan says: one sentence, tables, and what was left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from signlin_ros.digits import with_error
from signlin_ros.errors import joined
from signlin_ros.experiment.common_scale import force_parameters
from signlin_ros.experiment.plan import ExperimentPlan, PlanText
from signlin_ros.experiment.search import ENOUGH, NEEDED_EVIDENCE
from signlin_ros.names import printed_name

if TYPE_CHECKING:
    from signlin_ros.experiment.distance import RivalBench
    from signlin_ros.experiment.search import CommandSearch
    from signlin_ros.experiment.setting import KnownLimits

MAX_WEAK_PAIRS = 2
"""Pairs that a command does not tell apart which the sentence names."""
WORTH_ALONE = 1.3
"""Times as much that a command for two rivals alone must show to be told."""


def sentence(plan: ExperimentPlan) -> str:
    """Return the answer in one sentence."""
    alike = [one for one in plan.pairs if one.alike]
    apart = [one for one in plan.pairs if not one.alike and one.expected >= NEEDED_EVIDENCE]
    weak = [one for one in plan.pairs if not (one.alike or one.nested) and one.expected < NEEDED_EVIDENCE]
    parts = []
    if apart:
        worst = min(apart, key=lambda one: one.expected)
        what = _capital(plan.families[0].family.removesuffix(", refined")) if plan.families else "This command"
        rivals = joined(list(dict.fromkeys(n for one in apart for n in one.rivals)))
        only = f"{apart[0].rivals[0]} from {apart[0].rivals[1]}" if len(apart) == 1 else f"{rivals} from each other"
        more = " or more" if len(apart) > 1 else ""
        parts.append(
            f"{what} up to {np.abs(plan.u).max():.3g} {plan.unit} for {plan.duration:.3g} s would tell {only}:"
            f" expected {worst.expected:.3g}{more}, {NEEDED_EVIDENCE:g} is needed{_short(apart)}"
        )
    if weak:
        pairs = joined([f"{one.rivals[0]} from {one.rivals[1]}" for one in weak[:MAX_WEAK_PAIRS]], "nor")
        more = f", nor {len(weak) - MAX_WEAK_PAIRS} other pairs" if len(weak) > MAX_WEAK_PAIRS else ""
        expected = min(one.expected for one in weak)
        least = f"expected {expected:.2g}" + (" or more" if len(weak) > 1 else "")
        parts.append(f"it would not tell {pairs}{more}: {least}; plan for two by themselves with --between")
    for one in alike:
        helps = [r.what for r in plan.remedies if r.rivals == one.rivals]
        told = f"no command within these limits tells {one.rivals[0]} from {one.rivals[1]}"
        more = f"; what would: {joined(helps[:3], 'or')}" if helps else "; nor does anything else that was tried"
        parts.append(f"{told}: most {one.most:.2g}, {NEEDED_EVIDENCE:g} is needed{more}")
    if not parts:
        parts = [_nested(one) for one in plan.pairs if one.nested]
    return _capital("; ".join(parts)) + "."


def _short(apart: Sequence[PlanText]) -> str:
    """Return which pairs are told apart with less than is asked for, in words, and whether more can be had for two by
    themselves; empty where none is.
    """
    short = sorted((one for one in apart if one.expected < ENOUGH), key=lambda one: one.expected)
    if not short:
        return ""
    less = f", less than the {ENOUGH:g} that a plan asks for"
    if len(apart) == 1:
        return less
    names = []
    for one in short[:MAX_WEAK_PAIRS]:
        alone = f", {one.most:.3g} by themselves" if one.most > WORTH_ALONE * one.expected else ""
        names.append(f"{one.rivals[0]} from {one.rivals[1]} ({one.expected:.3g}{alone})")
    more = len(short) - MAX_WEAK_PAIRS
    names += [f"{more} other pair{'s' if more > 1 else ''}"] if more > 0 else []
    hint = (
        "; --between plans for two by themselves" if any(one.most > WORTH_ALONE * one.expected for one in short) else ""
    )
    return f"{less} of {joined(names)}{hint}"


def _nested(one: PlanText) -> str:
    """Return that one rival is nearly the other one, in words."""
    same = f"{one.rivals[0]} and {one.rivals[1]} are nearly the same, as the first records leave them"
    return f"{same}: their laws agree for some values, no command tells them apart, the simpler will be named"


def smallest(bench: RivalBench, told: Sequence[PlanText]) -> dict[str, str]:
    """Return by rival the smallest size of what it adds that the plan would show, in words: distances are squares."""
    found = {}
    for c in bench.contenders:
        own = [one.expected for one in told if c.name in one.rivals and not (one.alike or one.nested)]
        if c.size is None or not own or min(own) < NEEDED_EVIDENCE:
            continue
        i = c.index(c.size.name)
        k = c.candidate.coordinates[i]
        size, factor = k.value(float(c.theta[i])), float(np.sqrt(min(own) / NEEDED_EVIDENCE))
        value, name = (size * factor if c.size.stiff else size / factor), c.size.name.rpartition(".")[2]
        unit = bench.problem.shown(_unit(c.candidate.model, c.size.name))
        bound = "softer than" if c.size.stiff else "at least"
        found[c.name] = f"{name} {bound} {with_error(value, 0.2 * value)[0]} {unit}".rstrip()
    return found


def _unit(model: Any, name: str) -> str:
    from signlin_ros.model.numbers import declared
    from signlin_ros.recording.trace import resolve_unit

    return str(resolve_unit(declared(model)[name].unit, model.plant, False))


def notes(
    search: CommandSearch,
    rest: Sequence[KnownLimits],
    told: Sequence[PlanText],
    held: Sequence[KnownLimits] = (),
) -> tuple[str, ...]:
    """Return notes beside the answer; ``held``: rivals that no command moves."""
    found, bench, limits = [], search.bench, search.limits
    if limits.assumed:
        found.append(f"no limit was given for {joined(limits.assumed)}: what the first records visited is taken")
    found += [_nested(one) for one in told if one.nested]
    found += _scale_notes(search, told)
    if bench.bias:
        unit = {**bench.problem.base.units, **bench.problem.units}.get(bench.problem.base.inputs[0], "")
        found.append(f"the machine is held by {bench.bias:g} {unit} where it starts and ends; parts are about that")
    if rest:
        found.append(f"not planned for, though the records do not exclude it: {_names(rest)}; --between names which")
    if held:
        found.append(f"not planned for, since no command within the limits would move it as estimated: {_names(held)}")
    unlikely = [c.name for i, c in enumerate(bench.contenders) if bench.likely and i not in bench.likely]
    if unlikely:
        found.append(f"by the first records {joined(unlikely)} are unlikely: the plan is that they lose to the others")
    sized = [c for c in bench.contenders if c.size is not None]
    for c in sized:
        k = c.candidate.coordinates[c.index(c.size.name)] if c.size else None
        if c.size and k and c.size.least:  # none of a friction that the first records do not show at all
            name, bound = c.size.name.rpartition(".")[2], "at most" if c.size.stiff else "at least"
            unit = bench.problem.shown(_unit(c.candidate.model, c.size.name))
            value = with_error(c.size.least, 0.2 * c.size.least)[0]
            found.append(f"{c.name} is taken to be of interest with {name} {bound} {value} {unit}")
    return tuple(found)


def _names(rivals: Sequence[KnownLimits]) -> str:
    return joined([" with ".join(printed_name(n) for n in r.effects) or "nothing more" for r in rivals])


def _scale_notes(search: CommandSearch, told: Sequence[PlanText]) -> list[str]:
    """Return the note on a scale of all forces that nothing measured shows."""
    bench = search.bench
    larger = {c.name for c in bench.contenders if c.scale != 1.0}
    if not any(one.alike and larger & set(one.rivals) for one in told):
        return []
    names, seen = joined(list(force_parameters(bench.problem.base))), joined(list(bench.problem.channels))
    same = f"{seen} are the same whatever the scale that {names} and all other forces have in common"
    return [f"{same}: what is known of these beforehand sets it, and how large a friction or a load is found"]


def experiment_text(content: Mapping[str, Any]) -> str:
    """Return a plan as text, from its JSON."""
    command = content["command"]
    lines = [content["sentence"], "", f"Command ({command['input']}): {command['words']}"]
    lines.append(
        f"  {command['runs']} runs of {command['duration']:g} s, a sample every {command['dt']:g} s,"
        f" peak {command['peak']:.3g} {command['unit']}"
    )
    lines += _limits(content)
    lines += ["", "Rivals                                              expected  windows  so far"]
    for one in content["pairs"]:
        told = f"{one['rivals'][0]} / {one['rivals'][1]}"
        seen = "" if one["certainty"] is None else f"{one['certainty']:.1f}"
        lines.append(f"  {told:<49} {one['expected']:>8.3g} {seen:>8} {one['so_far'] or 0.0:>7.2g}")
    lines += ["", "The best command of each family                     distance     peak  limits"]
    for row in content["families"]:
        distance = "" if row["distance"] is None else f"{row['distance']:.3g}"
        lines.append(f"  {row['family']:<50}{distance:>8} {row['peak']:>8.3g} {100 * row['part_of_limits']:>5.0f} %")
    if content["smallest"]:
        lines += ["", *(f"The smallest that would show: {n}: {what}" for n, what in content["smallest"].items())]
    if content["remedies"]:
        lines += ["", "What else would tell:"]
        lines += [f"  {r['what']}: {r['distance']:.3g} ({' / '.join(r['rivals'])})" for r in content["remedies"]]
    lines += ["", *(f"note: {n}" for n in content["notes"])] if content["notes"] else []
    if content["verdict"] == "none":
        lines += ["", "The command of the largest distance is written all the same; a record of it decides nothing."]
    elif content["after"]:
        lines += ["", "Record it twice, then:", f"  {content['after']}"]
    return "\n".join(lines)


def _limits(content: Mapping[str, Any]) -> list[str]:
    """Return the visited share of each limit."""
    visits, rows = content["visits"], []
    for name, one in content["limits"].items():
        if name in visits:
            rows.append(f"{name} {visits[name]['most']:.3g} of {one['most']:.3g} {visits[name]['unit']}".rstrip())
    return (
        [f"  expected: {', '.join(rows)}; {100 * content['spare']:g} % of each limit is kept to spare"] if rows else []
    )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


__all__ = ["experiment_text", "notes", "sentence", "smallest"]
