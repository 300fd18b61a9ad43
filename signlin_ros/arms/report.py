"""The report on an arm: a table of its joints, what is said of each, and what is left of each effort, before and after.

One HTML file with its pictures beside it, as `signlin_ros.report` writes them.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros import __version__
from signlin_ros.arms.piece import RegressionRows
from signlin_ros.arms.study import Study
from signlin_ros.arms.told import CANNOT
from signlin_ros.arms.verbs import ArmComparison, ArmDiagnosis
from signlin_ros.names import printed_name
from signlin_ros.plotting import EXACT_COLOUR, MIDPOINT, START_COLOUR, legend_above, styled
from signlin_ros.report.files import write_report
from signlin_ros.report.page import Block, Code, Items, Page, Picture, ReportTable, Section, Text

Array = NDArray[np.float64]
JOINT_COLUMNS = {
    "effort": "effort",
    "as_given": "URDF",
    "rigid": "rigid refit",
    "basic": "+ friction",
    "model": "model",
}
"""Columns of the table of joints, and what they are called."""
HEIGHT = 1.25
"""Inches of a joint's picture."""


def arm_report(
    result: ArmComparison | ArmDiagnosis, content: Mapping[str, Any], path: str | Path, command: str
) -> Path:
    """Write the report on a comparison or a diagnosis of an arm; return its path.

    content : what the verb prints as JSON. Raises `InputError` where it cannot be written.
    """
    diagnosis = result if isinstance(result, ArmDiagnosis) else None
    comparison = result.comparison if isinstance(result, ArmDiagnosis) else result
    sections = [
        Section("What is missing", [Items([_split(line) for line in content.get("sentences", [])])]),
        Section("Joints", [_table(content), Text(_HOW.format(content["band_hz"]), "note")]),
        Section("What is left of each effort", _pictures(comparison, diagnosis)),
        Section("Basic friction", [_basic(content)]),
        Section("Cannot be told", [Items(_cannot(content))]),
        Section("The record", _record(content.get("record", {}))),
        Section("Notes", [Items([("", note) for note in content["notes"]])] if content["notes"] else []),
        Section("To reproduce", [Code(command)] if command else []),
    ]
    if "sentences" not in content:
        sections = sections[1:]
    verb = "Diagnosis" if diagnosis else "Comparison"
    title = f"{verb} of {Path(comparison.study.model.source).name}"
    badge = (content["verdict"], content["verdict"]) if diagnosis else ("", "")
    foot = f"signlin_ros {__version__}, {dt.date.today().isoformat()}"
    return write_report(Page(title, badge, _lead(content), sections, foot), path)


_HOW = (
    "RMS below {:g} Hz of what is left of the effort, on data that no fit saw. URDF: as given. Rigid refit: inertial"
    " parameters near those of the URDF. + friction: viscous and Coulomb friction, offset and motor inertia beside it."
)


def _split(line: str) -> tuple[str, str]:
    head, _, rest = line.partition(": ")
    return head, rest


def _lead(content: Mapping[str, Any]) -> str:
    named = [printed_name(entry["effect"]) for entry in content.get("ranking", [])]
    named += [f"a coupling of {' and '.join(pair)}" for pair in content.get("found_couplings", [])]
    if named:
        return f"{', '.join(named)}."
    shares = {n: j["model"] / j["effort"] for n, j in content["joints"].items() if j["model"] and j["effort"]}
    if not shares:
        return "No joint moves enough to tell anything."
    worst = max(shares, key=lambda name: shares[name])
    return f"The model leaves at most {shares[worst]:.0%} of an effort ({worst})."


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _table(content: Mapping[str, Any]) -> Block:
    head = ["joint", "unit", *JOINT_COLUMNS.values(), "named"]
    rows = [
        [name, own["unit"], *(_number(own[key]) for key in JOINT_COLUMNS), ", ".join(own["effects"])]
        for name, own in content["joints"].items()
    ]
    return ReportTable(head, rows, right=range(2, 7))


def _basic(content: Mapping[str, Any]) -> Block:
    rows = [
        [name, *(f"{v['value']:.4g} {v['unit']}" for v in own["basic_parameters"].values())]
        for name, own in content["joints"].items()
    ]
    return ReportTable(["joint", "viscous", "Coulomb", "offset", "motor inertia"], rows)


def _cannot(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    own = [(name, why) for name, joint in content["joints"].items() for why in joint["cannot_tell"]]
    return [*own, *(("", why) for why in CANNOT)]


def _record(record: Mapping[str, Any]) -> list[Block]:
    items = [(f"{f['severity']}, {f['check']}", f["sentence"]) for f in record.get("findings", [])]
    return [Items(items)] if items else []


# ---------------------------------------------------------------- pictures


def _pictures(comparison: ArmComparison, diagnosis: ArmDiagnosis | None) -> list[Block]:
    study = comparison.study
    rows = study.new
    left = {"the model as given": (START_COLOUR, study.left(study.model, rows))}
    if diagnosis is not None:
        left["the model proposed"] = (MIDPOINT, study.left(diagnosis.proposal.model, rows))
    else:
        left["with basic friction, refitted"] = (MIDPOINT, comparison.basic.unseen)
    caption = (
        "Validation data, as far as the joints move. Grey: the measured effort. Colours: what a model leaves of it."
    )
    by_speed = "What is left against the joint's own velocity: friction that is missing shows as a curve."
    return [
        Picture("left_over_time", _over_time(study, rows, left), caption, "residual efforts of all joints over time"),
        Picture("left_by_speed", _by_speed(study, rows, left), by_speed, "residual efforts against velocities"),
    ]


def _of_joint(rows: RegressionRows, values: Array, i: int) -> list[tuple[Array, Array, Array]]:
    """Return time (s), the joint's velocity, and values of a joint's rows, run by run."""
    found: list[tuple[Array, Array, Array]] = []
    at, start = 0, 0.0
    for piece in rows.pieces:
        for j in range(rows.n):
            kept = piece.index[piece.moving[:, j]]
            if j == i:
                found.append(
                    (np.asarray(start + kept * piece.step), np.asarray(piece.v[kept, i]), values[at : at + kept.size])
                )
            at += kept.size
        start += len(piece.q) * piece.step
    return found


def _over_time(study: Study, rows: RegressionRows, left: Mapping[str, tuple[str, Array]]) -> Any:
    with styled(9.5, 0.8 + HEIGHT * rows.n) as figure:
        axes = figure.subplots(rows.n, 1, sharex=True, squeeze=False)[:, 0]
        for i, ax in enumerate(axes):
            for t, _, y in _of_joint(rows, rows.y, i):
                ax.plot(t, y, ".", ms=1.0, color=EXACT_COLOUR, alpha=0.3)
            for name, (colour, values) in left.items():
                for k, (t, _, r) in enumerate(_of_joint(rows, values, i)):
                    ax.plot(t, r, ".", ms=2.0, color=colour, label=name if not k else None)
            ax.set_ylabel(f"{study.names[i]}\n[{study.robot.joints[i].effort_unit}]", fontsize=7)
        axes[-1].set_xlabel("time [s]")
        legend_above(figure, axes[0], 2)
    return figure


def _by_speed(study: Study, rows: RegressionRows, left: Mapping[str, tuple[str, Array]]) -> Any:
    across = min(3, rows.n)
    down = -(-rows.n // across)
    with styled(9.5, 0.8 + 2.0 * down) as figure:
        axes: Sequence[Any] = figure.subplots(down, across, squeeze=False).ravel()
        for i, ax in enumerate(axes[: rows.n]):
            for name, (colour, values) in left.items():
                for k, (_, v, r) in enumerate(_of_joint(rows, values, i)):
                    ax.plot(v, r, ".", ms=2.0, color=colour, label=name if not k else None)
            joint = study.robot.joints[i]
            ax.set_title(joint.name, fontsize=8)
            ax.set_xlabel(f"velocity [{joint.position_unit}/s]")
            ax.set_ylabel(f"left [{joint.effort_unit}]")
        for ax in axes[rows.n :]:
            ax.set_visible(False)
        legend_above(figure, axes[0], 2)
    return figure


__all__ = ["arm_report"]
