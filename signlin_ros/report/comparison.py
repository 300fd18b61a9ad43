"""The report on a comparison: how good a model is on measurements, and where it fails."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from signlin_ros import __version__
from signlin_ros.checks.finding import Finding
from signlin_ros.comparison.scores import Score
from signlin_ros.console import error_rows
from signlin_ros.diagnosis.compared import Comparison
from signlin_ros.diagnosis.comparison import NO_SITUATION
from signlin_ros.diagnosis.results import LadderRow
from signlin_ros.errors import SignlinError
from signlin_ros.names import AS_GIVEN, AT_NOISE_RATIO, REFITTED_ROW
from signlin_ros.report import pictures
from signlin_ros.report.files import write_report
from signlin_ros.report.page import Block, Code, Items, Page, Picture, ReportTable, Section, Text


def compare_report(
    comparison: Comparison,
    path: str | Path,
    command: str = "",
    record: Sequence[Finding] = (),
    first: Sequence[Section] = (),
    lead: str = "",
) -> Path:
    """Write the report on a comparison to ``path`` (HTML) and its pictures beside it; return the path.

    ``command``: the command line that leads to it; ``record``: what was found in the records; ``first``: sections
    before all others, and ``lead`` before the first sentence. Raises `InputError` where it cannot be written.
    """
    c = comparison
    sections = [
        *first,
        Section("The record", findings(record)),
        Section("Scores", [*_first_rows(c), scores_table(c), Text(_HOW_SCORED, "note"), *_effort(c)]),
        Section("Measured and predicted", _traces(c)),
        Section("Where it fails", where(c)),
        Section("What is missing", _missing(c)),
        Section("What is left in the residual", [_tests(c), *_spectrum(c)]),
        Section("Notes", notes([*c.notes, *([c.without_rows] if c.without_rows else [])], record)),
        Section("To reproduce", reproduce(command)),
    ]
    title = f"Comparison of {name_of(c.model.source)} with {names_of(c.sources)}"
    return write_report(Page(title, ("", ""), f"{lead} {_lead(c)}".strip(), sections, foot()), path)


def name_of(source: str) -> str:
    """Return the file name of a source."""
    return Path(source).name


def names_of(sources: Sequence[str]) -> str:
    """Return file names; several as their number and the first."""
    names = list(dict.fromkeys(name_of(s) for s in sources))
    return ", ".join(names) if len(names) < 4 else f"{len(names)} records ({names[0]}, ...)"


def foot() -> str:
    """Return the last line of a report."""
    return f"signlin_ros {__version__}, {dt.date.today().isoformat()}"


def number(value: float | None, unit: str = "") -> str:
    """Return a number as in tables."""
    return "-" if value is None else f"{value:.3g} {unit}".rstrip()


def percent(value: float | None) -> str:
    """Return per cent as in tables."""
    return "-" if value is None else f"{value:.1f} %"


def _lead(c: Comparison) -> str:
    rows = c.first_rows
    shown = rows.given.validation.channels if rows else {n: channel.windowed for n, channel in c.channels.items()}
    worst = max(shown, key=lambda n: _over(shown[n]))
    score = shown[worst]
    if score is None or score.rmse_over_noise is None:
        return f"{c.samples} samples."
    at_noise = score.rmse_over_noise <= AT_NOISE_RATIO
    noise = "no larger than the noise" if at_noise else f"{score.rmse_over_noise:.3g} times the noise"
    which = "Every prediction" if at_noise else f"The prediction of the {worst}"
    where = f"; most of the error: {c.where[0].name}" if c.where else ""
    unseen = f"over the next {rows.horizon:.3g} s, on validation data," if rows else f"over the next {c.horizon:.3g} s"
    return f"{which} {unseen} is {noise}{where}."


def _over(score: Score | None) -> float:
    return score.rmse_over_noise or 0.0 if score else 0.0


def _first_rows(c: Comparison) -> list[Block]:
    """Return the rows that a diagnosis of the same records begins with."""
    rows = c.first_rows
    if rows is None:
        return []
    units = {name: channel.unit for name, channel in c.channels.items()}
    table = rows_table([(AS_GIVEN, rows.given), (REFITTED_ROW, rows.refitted)], lambda name: units.get(name, ""))
    return [table, Text(_AHEAD.format(f"{rows.horizon:.3g}"), "note")]


def rows_table(named: Sequence[tuple[str, LadderRow]], unit: Callable[[str], str]) -> ReportTable:
    """Return the rows by which models are told apart: a group for each, the noise of the sensors last."""
    head = ["model", "channel", "unit", "training data", "over noise", "validation data", "fit", "over noise"]
    units = {name: unit(name) for _, rung in named for name in rung.validation.channels}
    found = error_rows([(name, rung.to_json()) for name, rung in named])
    rows = [[name, channel, units.get(channel, "of the effort"), *cells] for name, channel, *cells in found]
    return ReportTable(head, rows, right=range(3, 8))


_AHEAD = (
    "RMS errors over windows of {} s, each from what was measured before it. Refitted: the base parameters moved within"
    " their tolerances. Missing force: what the measured motion takes beyond the model, on validation data, in "
    "per cent of"
    " the effort. Noise: of the sensors alone."
)


def scores_table(c: Comparison) -> ReportTable:
    """Return the scores of every channel; over windows only where the first rows do not show that."""
    shown = c.first_rows is not None and c.first_rows.horizon == c.horizon
    ahead = [] if shown else [f"next {c.horizon:.3g} s", "fit", "over noise"]
    head = ["", "unit", "noise", "free run", "fit", "over noise", *ahead]
    rows = [
        [name, one.unit, number(one.sigma), *_score(one.free_run), *(_score(one.windowed) if ahead else [])]
        for name, one in c.channels.items()
    ]
    return ReportTable(head, rows, right=range(2, 9))


_HOW_SCORED = (
    "RMS errors over all samples. Free run: simulated from an estimated start. Over windows, where shown: each from"
    " what was measured before it. Fit: 100 % less the error over the spread of what was measured."
)


def _score(s: Score | None) -> list[str]:
    return [number(s.rmse), percent(s.fit_percent), number(s.rmse_over_noise)] if s else ["-"] * 3


def _effort(c: Comparison) -> list[Block]:
    return [
        Text(
            f"The {name} computed from the measured motion is {number(i.rmse, i.unit)} off (RMS),"
            f" {percent(i.relative_error_percent)} of the measured one, below {i.cutoff_hz:g} Hz."
        )
        for name, i in c.inverse.items()
    ]


def _traces(c: Comparison) -> list[Block]:
    caption = "Black: measured. Orange: simulated from the start. Blue: predicted over windows, each from what was"
    picture = Picture(
        "measured_and_simulated",
        pictures.measured_and_simulated(c),
        f"{caption} measured before it. Shaded: where the error is concentrated, or else large.",
        "every channel over time, measured and predicted",
    )
    return [picture]


def where(c: Comparison) -> list[Block]:
    """Return the situations in which a model fails, as a table."""
    if not c.where:
        rest = "." if any(m.clear for m in c.missing) else ": nothing stands out of the noise."
        return [Text(f"{NO_SITUATION[:1].upper()}{NO_SITUATION[1:]}{rest}")]
    rows = [
        [
            r.name,
            f"{r.share_of_error:.0f} %",
            f"{r.share_of_time:.0f} %",
            "" if r.kind == "frequency" else f"{r.mean:.3g} ± {2 * r.mean_std:.1g} {r.unit}",
        ]
        for r in c.where
    ]
    head = ["situation", "of the error", "of the time", f"missing {c.where[0].what} there, mean ± 2 standard errors"]
    return [ReportTable(head, rows, right=(1, 2))]


def _missing(c: Comparison) -> list[Block]:
    if not c.missing:
        return [Text("What is missing cannot be told: the record does not measure enough.")]
    found: list[Block] = []
    for name, (draw, caption) in _OF_WHAT_IS_MISSING.items():
        found += drawing(name, draw, caption, c)
    return found


OVER_TIME = "The same over time: what comes and goes by itself, swings on, or drifts, shows here."
_OF_WHAT_IS_MISSING = {
    "missing_force": (
        pictures.missing_against,
        "What the equations lack, against each coordinate; the band is the mean with two standard errors.",
    ),
    "missing_over_time": (pictures.missing_over_time, OVER_TIME),
    "error_map": (pictures.error_map, "How much is missing, over two coordinates at once."),
    "loop": (
        pictures.hysteresis_loop,
        "The force with which springs and friction resist. An open loop that the model does not have is friction.",
    ),
}


def drawing(name: str, draw: Any, caption: str, *arguments: Any) -> list[Block]:
    """Return a picture, nothing where it cannot be drawn of this record."""
    try:
        figure = draw(*arguments)
    except SignlinError:
        return []
    return [Picture(name, figure, caption, caption.split(".", maxsplit=1)[0])]


def _tests(c: Comparison) -> ReportTable:
    yes = {True: "yes", False: "no"}
    rows = [[n, f"{t.lag1:.2f}", yes[t.white], yes[t.input_correlated]] for n, t in c.residual_tests.items()]
    return ReportTable(["", "correlation of neighbours", "white", "follows the input"], rows, right=(1,))


def _spectrum(c: Comparison) -> list[Block]:
    caption = "Spectra of what was measured and of what is left of it. Dashed: the noise of the sensor."
    return drawing("spectrum", pictures.spectrum, caption, c)


def notes(texts: Sequence[str], record: Sequence[Finding] = ()) -> list[Block]:
    """Return notes as a list, without what is among the findings about the record."""
    told = {f"{f.source}: {f.said}" for f in record}
    rest = [text for text in dict.fromkeys(texts) if text not in told]
    return [Items([("", text) for text in rest])] if rest else []


def findings(record: Sequence[Finding]) -> list[Block]:
    """Return the findings in records as an HTML list."""
    ways = [f" ({f.way_out})" if f.way_out else "" for f in record]
    texts = [f"{name_of(f.source)}: {f.said}{way}" for f, way in zip(record, ways, strict=True)]
    items = [(f"{f.severity}, {f.check}", text) for f, text in zip(record, texts, strict=True)]
    return [Items(items)] if items else []


def reproduce(command: str) -> list[Block]:
    """Return the command line that leads to a report."""
    return [Code(command)] if command else []


__all__ = ["compare_report"]
