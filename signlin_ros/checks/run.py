"""All checks on records, and their cures."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from signlin_ros.checks.base import Check
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import LEAST, Look
from signlin_ros.checks.no_motion import NoMotion
from signlin_ros.checks.registry import CHECKS
from signlin_ros.errors import InputError, RecordError, choices, suggest
from signlin_ros.model import Model
from signlin_ros.records import ModelData

NONE = "none"
"""The cure that takes records as they are: nothing is changed, nothing refused."""


def check(
    model: Model, records: Sequence[ModelData], cures: Collection[str] = (), *, validated: bool = False
) -> tuple[list[ModelData], list[Finding]]:
    """Look for what may be wrong with records; return them with cures applied, and what was found.

    Cures that can do no harm are applied; others if their names are among ``cures``; none at all with `NONE` there.
    ``validated``: whether some of the records are for validation, so that no part of one is held out.
    Raises `InputError` for a cure that nothing here offers.
    """
    kinds = [kind for kind in CHECKS if not (validated and kind.holding_out)]
    pairs = [_checked(model, record, frozenset(cures), kinds) for record in records]
    findings = [finding for _, found in pairs for finding in found]
    _check_names(cures, findings)
    return [record for record, _ in pairs], findings


def require_sound(findings: Sequence[Finding], cures: Collection[str] = ()) -> None:
    """Raise `RecordError` for the first finding that must be decided before anything is concluded."""
    blocking = [] if NONE in cures else [finding for finding in findings if finding.open]
    for finding in blocking[:1]:
        others = ", ".join(dict.fromkeys(one.source for one in blocking[1:]))
        more = f" ({len(blocking) - 1} more, of {others}: signlin check)" if others else ""
        ways = "; ".join(way for way in (finding.way_out, "--cure none: the record is taken as it is") if way)
        raise RecordError(f"{finding.source}: {finding.sentence}; {ways}{more}")


def _checked(
    model: Model, record: ModelData, cures: frozenset[str], kinds: Sequence[type[Check]]
) -> tuple[ModelData, list[Finding]]:
    found: list[Finding] = []
    look = Look(model, record)
    if not look.channels or look.t.size < LEAST:  # nothing to look at: what comes next says so
        return record, found
    for kind in kinds:
        if kind.needs_time and ("t" in look.told or any(f.check == NoMotion.name for f in found)):
            continue
        told = []
        for finding in kind().find(look):
            record, treated = _treated(record, replace(finding, source=record.source), cures)
            told.append(treated)
        applied = [finding for finding in told if finding.applied]
        found += applied if kind.exclusive and applied else told
        look = look.on(record, tuple(name for finding in found if finding.doubtful for name in finding.about))
    return record, found


def _treated(record: ModelData, finding: Finding, cures: frozenset[str]) -> tuple[ModelData, Finding]:
    """Return a record with the cure of a finding applied where it is to be, and the finding."""
    wanted = finding.harmless if NONE not in cures else False
    if finding.action is not None and (wanted or finding.cure in cures):
        return finding.action(record), finding.done()
    return record, replace(finding, severity="offer") if finding.harmless else finding


def _check_names(cures: Collection[str], findings: Sequence[Finding]) -> None:
    offered = {finding.cure for finding in findings if finding.cure}
    for name in cures:
        if name != NONE and name not in offered:
            allowed = choices([*offered, NONE])
            raise InputError(f"--cure: found {name!r}; for these records there are: {allowed}{suggest(name, offered)}")


__all__ = ["NONE", "check", "require_sound"]
