"""What was added to a model, step by step: the section of a report on the model as it is now."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from signlin_ros.console import error_rows
from signlin_ros.diagnosis.results import Diagnosis
from signlin_ros.model import Model
from signlin_ros.names import AS_GIVEN, REFITTED_ROW, capitalised, printed_name
from signlin_ros.report.diagnosis import evidence_blocks
from signlin_ros.report.formulas import formula
from signlin_ros.report.page import Block, ReportTable, Section, Text


@dataclass(frozen=True, eq=False)
class Added:
    """An effect that was added: what `signlin add --json` printed, and the result itself, where it is at hand."""

    effect: str
    content: dict[str, Any]
    result: Diagnosis | None = None


def added_section(steps: Sequence[Added], model: Model) -> Section:
    """Return the section: for each step its formula, sentence and evidence; then the errors from step to step."""
    blocks: list[Block] = []
    for step in steps:
        blocks += [Text(capitalised(printed_name(step.effect)), "head"), formula(step.effect, model)]
        blocks.append(Text(step.content["sentence"]))
        blocks += evidence_blocks(step.result, step.effect) if step.result is not None else []
    return Section("What was added to the model", [*blocks, _errors(steps)] if steps else [])


def lead_of(steps: Sequence[Added]) -> str:
    """Return the first sentence of a report on the additions."""
    names = [printed_name(step.effect) for step in steps]
    return f"The model has {' and '.join(names)}, added from these records." if names else ""


def _errors(steps: Sequence[Added]) -> ReportTable:
    """Return the errors on validation data before, and after every step."""
    named = []
    for k, step in enumerate(steps):
        given, ladder = step.content.get("given"), step.content["ladder"]
        if k == 0:
            named += [(AS_GIVEN, given)] if given else []
            named.append((REFITTED_ROW if given else AS_GIVEN, ladder[0]))
        named.append((f"+ {printed_name(step.effect)}", ladder[-1]))
    head = ["model", "channel", "data of the fit", "over noise", "validation data", "fit", "over noise"]
    return ReportTable(head, error_rows(named), right=range(2, 7))


__all__ = ["Added", "added_section", "lead_of"]
