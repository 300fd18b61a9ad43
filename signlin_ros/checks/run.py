"""All checks on records, and their cures."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from signlin_ros.checks.base import Check
from signlin_ros.checks.finding import Finding
from signlin_ros.checks.look import MIN_SAMPLES, Look
from signlin_ros.checks.no_motion import NoMotion
from signlin_ros.checks.registry import CHECKS
from signlin_ros.errors import InputError, RecordError, choices, suggest
from signlin_ros.model import Model
from signlin_ros.records import ModelData

NO_CURE = "none"
"""The cure that takes records as they are: nothing is changed, nothing refused."""


def check(
    model: Model,
    records: Sequence[ModelData],
    cures: Collection[str] = (),
    *,
    validated: bool = False,
    kinds: Sequence[type[Check]] = CHECKS,
) -> tuple[list[ModelData], list[Finding]]:
    """Look for what may be wrong with records; return them with cures applied, and what was found.

    Cures that can do no harm are applied; others if their names are among ``cures``; none at all with `NO_CURE` there.
    ``validated``: whether some of the records are for validation, so that no part of one is held out. ``kinds``: the
    checks that mean anything for the model, in their order.
    Raises `InputError` for a cure that nothing here offers.
    """
    passes = [_Pass(model, record) for record in records]
    for kind in (kind for kind in kinds if not (validated and kind.holding_out)):
        for group in _of_one_log(passes):
            ready = [one for one in group if one.takes(kind)]
            for one, told in zip(ready, kind().find_each([one.look for one in ready]), strict=True):
                one.treat(kind, told, frozenset(cures))
    findings = [finding for one in passes for finding in one.found]
    check_cures(cures, findings)
    return [one.record for one in passes], findings


def require_sound(findings: Sequence[Finding], cures: Collection[str] = ()) -> None:
    """Raise `RecordError` for the first finding that must be decided before anything is concluded."""
    blocking = [] if NO_CURE in cures else [finding for finding in findings if finding.open]
    for finding in blocking[:1]:
        others = ", ".join(dict.fromkeys(one.source for one in blocking[1:]))
        more = f" ({len(blocking) - 1} more, of {others}: signlin check)" if others else ""
        plain = "" if finding.final else "--cure none: the record is taken as it is"
        ways = "".join(f"; {way}" for way in (finding.way_out, plain) if way)
        raise RecordError(f"{finding.source}: {finding.sentence}{ways}{more}")


class _Pass:
    """A record on its way through the checks: as it is by then, and what was found."""

    def __init__(self, model: Model, record: ModelData) -> None:
        self.record, self.look = record, Look(model, record)
        self.found: list[Finding] = []
        self._enough = self.look.t.size >= MIN_SAMPLES

    def takes(self, kind: type[Check]) -> bool:
        """Tell whether a check means anything here: there is something to look at, and the time is known."""
        if not self._enough or (not self.look.channels and not kind.of_nothing):
            return False
        if kind.needs_input and any(f.open and f.channel in self.record.inputs for f in self.found):
            return False
        return not (
            kind.needs_time and ("t" in self.look.reported or any(f.check == NoMotion.name for f in self.found))
        )

    def treat(self, kind: type[Check], findings: Sequence[Finding], cures: frozenset[str]) -> None:
        """Take what a check found, and apply the cures that are to be."""
        told = []
        for finding in findings:
            self.record, treated = _treated(self.record, replace(finding, source=self.record.source), cures)
            told.append(treated)
        applied = [finding for finding in told if finding.applied]
        self.found += applied if kind.exclusive and applied else told
        about = tuple(name for finding in self.found if finding.doubtful for name in finding.about)
        self.look = self.look.on(self.record, about)


def _of_one_log(passes: Sequence[_Pass]) -> list[list[_Pass]]:
    """Return the records by their columns."""
    groups: dict[object, list[_Pass]] = {}
    for one in passes:
        r = one.record
        key = (r.inputs, r.states, tuple(sorted(r.units.items())), tuple(sorted(r.labels.items())))
        groups.setdefault(key, []).append(one)
    return list(groups.values())


def _treated(record: ModelData, finding: Finding, cures: frozenset[str]) -> tuple[ModelData, Finding]:
    """Return a record with the cure of a finding applied where it is to be, and the finding."""
    wanted = finding.harmless if NO_CURE not in cures else False
    if finding.action is not None and (wanted or finding.cure in cures):
        return finding.action(record), finding.done()
    return record, replace(finding, severity="offer") if finding.harmless else finding


def check_cures(cures: Collection[str], findings: Sequence[Finding]) -> None:
    """Raise `InputError` for a cure that none of the findings offers."""
    offered = {finding.cure for finding in findings if finding.cure}
    for name in cures:
        if name != NO_CURE and name not in offered:
            allowed = choices([*sorted(offered), NO_CURE])
            raise InputError(f"--cure: found {name!r}; for these records there are: {allowed}{suggest(name, offered)}")


__all__ = ["NO_CURE", "check", "check_cures", "require_sound"]
