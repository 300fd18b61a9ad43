"""The report on a plan: the answer, what each rival would show, the best commands, what else would tell."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from signlin_ros.experiment.plan import ExperimentPlan
from signlin_ros.experiment.preview import PreviewCurve
from signlin_ros.experiment.search import ENOUGH, NEEDED_EVIDENCE
from signlin_ros.names import printed_name
from signlin_ros.plotting import EXACT_COLOUR, MIDPOINT, SHADE, START_COLOUR, legend_above, styled
from signlin_ros.report.comparison import foot, number
from signlin_ros.report.files import write_report
from signlin_ros.report.page import Block, Code, Items, Page, Picture, ReportTable, Section, Text

NOISE_BAND = 2.0
"""Standard deviations of the noise that are drawn about what a rival would show."""
_HOW_PLANNED = (
    f"Expected: -2 log likelihood that the wrong rival leaves, refitted from its estimate, beyond the right one; the"
    f" smaller of both ways, from the estimates and a standard error beside them. {NEEDED_EVIDENCE:g} tells them apart,"
    f" {ENOUGH:g} is asked of a plan, since noise takes some of it away. Windows: standard errors by which the right"
    " one predicts a second run better over the horizon of the diagnosis. So far: what the first records say."
)
_FAMILIES = (
    "Distance: of the two rivals that are hardest to tell apart, by refits at the estimates. The quietest commands that"
    " are enough come first; a machine that cannot run the first may run the second."
)


def experiment_report(plan: ExperimentPlan, path: str | Path, command: str = "") -> Path:
    """Write the report on a plan to ``path`` (HTML) and its pictures beside it; return the path.

    Raises `InputError` where it cannot be written, `MissingExtraError` without matplotlib.
    """
    sections = [
        Section("The command", _command(plan)),
        Section("What each rival would show", _previews(plan)),
        Section("How sure it would be", [_pairs(plan), Text(_HOW_PLANNED, "note"), *_smallest(plan)]),
        Section("The best command of each family", [_families(plan), Text(_FAMILIES, "note")]),
        Section("What else would tell", _remedies(plan)),
        Section("Notes", [Items([("", note) for note in plan.notes])] if plan.notes else []),
        Section("Then", _then(plan)),
        Section("To reproduce", [Code(command)] if command else []),
    ]
    kind = {"enough": "adequate", "none": "unexplained"}.get(plan.verdict, "missing")
    return write_report(Page("The next experiment", (kind, plan.verdict), plan.sentence, sections, foot()), path)


def _then(plan: ExperimentPlan) -> list[Block]:
    if plan.verdict == "none":
        return [Text("The command of the largest distance is written all the same; a record of it decides nothing.")]
    return [Text("Record the command twice: one run to fit, one to validate."), Code(plan.after)]


def _command(plan: ExperimentPlan) -> list[Block]:
    visits = [(n, v, plan.limits[n], plan.units.get(n, "")) for n, v in plan.visits.items()]
    rows = [[n, number(v, unit), number(most, unit), f"{100 * v / most:.0f} %"] for n, v, most, unit in visits]
    peak = float(np.abs(plan.u).max())
    rows.insert(
        0,
        [
            plan.input,
            number(peak, plan.unit),
            number(plan.limits[plan.input], plan.unit),
            f"{100 * peak / plan.limits[plan.input]:.0f} %",
        ],
    )
    table = ReportTable(["quantity", "most, by any rival's estimate", "limit", "part"], rows, (1, 2, 3))
    length = f"Two runs of {plan.duration:g} s, a sample every {plan.step:g} s, at rest at both ends."
    return [Text(f"{plan.words}."), Text(length), table]


def _pairs(plan: ExperimentPlan) -> ReportTable:
    rows = []
    for one in plan.pairs:
        seen = number(one.certainty) if np.isfinite(one.certainty) else "-"
        rows.append([" / ".join(one.rivals), number(one.expected), seen, number(one.so_far)])
    return ReportTable(["rivals", "expected", "windows", "so far"], rows, (1, 2, 3))


def _smallest(plan: ExperimentPlan) -> list[Block]:
    if not plan.smallest:
        return []
    return [Text("The smallest that would show:"), Items([*plan.smallest.items()])]


def _families(plan: ExperimentPlan) -> ReportTable:
    rows = []
    for row in plan.families:
        distance = number(row.distance) if row.real else "-"
        asked = ", ".join(printed_name(n) for n in row.texts[:3])
        rows.append([row.family, row.words, number(row.peak, plan.unit), distance, f"{100 * row.share:.0f} %", asked])
    return ReportTable(["family", "command", "peak", "distance", "limits", "asked for by"], rows, (2, 3, 4))


def _remedies(plan: ExperimentPlan) -> list[Block]:
    rows = [[" / ".join(r.rivals), r.what, number(r.distance)] for r in plan.remedies]
    return [ReportTable(["rivals", "remedy", "distance"], rows, (2,))] if rows else []


def _previews(plan: ExperimentPlan) -> list[Block]:
    found: list[Block] = []
    for k, shown in enumerate(plan.preview or ()):
        first, second = shown.rivals
        caption = (
            f"Where {first} is true, and {second}, refitted, imitates it as well as it can; the band is ±{NOISE_BAND:g}"
            " noise. Distance: the sum up to that time, through the observer; where it rises, the command decides."
        )
        found.append(Picture(f"preview_{k + 1}", picture(plan, shown), caption, f"{first} and {second} over time"))
    return found


def picture(plan: ExperimentPlan, shown: PreviewCurve) -> Any:
    """Return a figure: the command, what two rivals would show by channel, and the distance so far, over time."""
    count = len(shown.channels)
    with styled(9.0, 2.6 + 1.6 * count) as figure:
        axes = figure.subplots(count + 2, 1, sharex=True)
        axes[0].plot(plan.t, plan.u, color=EXACT_COLOUR)
        axes[0].set_ylabel(f"{plan.input} [{plan.unit}]")
        for k, (name, unit) in enumerate(zip(shown.channels, shown.units, strict=True)):
            ax, true, band = axes[k + 1], shown.true[:, k], NOISE_BAND * shown.noise[k]
            ax.fill_between(shown.t, true - band, true + band, color=SHADE, alpha=0.3, lw=0, label="± 2 noise")
            ax.plot(shown.t, true, color=MIDPOINT, label=shown.rivals[0])
            ax.plot(shown.t, shown.other[:, k], color=START_COLOUR, ls="--", label=f"{shown.rivals[1]}, refitted")
            ax.set_ylabel(f"{name} [{unit}]")
        axes[-1].plot(shown.t, shown.distance, color=EXACT_COLOUR)
        axes[-1].axhline(NEEDED_EVIDENCE, color=START_COLOUR, lw=0.8, ls=":")
        axes[-1].set_ylabel("distance")
        axes[-1].set_xlabel("time [s]")
        legend_above(figure, axes[1], 3)
    return figure


__all__ = ["experiment_report", "picture"]
