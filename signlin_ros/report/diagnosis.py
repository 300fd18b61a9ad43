"""The report on a diagnosis: the verdict, the evidence for it, and what the record cannot tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from signlin_ros.checks.finding import Finding
from signlin_ros.diagnosis.compared import Comparison
from signlin_ros.diagnosis.comparison import compare
from signlin_ros.diagnosis.effect_evidence import EffectEvidence
from signlin_ros.diagnosis.results import Diagnosis, ParameterEstimate, RankingEntry
from signlin_ros.errors import SignlinError
from signlin_ros.fitting.prepare import held_out
from signlin_ros.model import Model
from signlin_ros.model.numbers import numbers
from signlin_ros.names import AS_GIVEN, REFITTED_ROW, capitalised, printed_name
from signlin_ros.records import ModelData
from signlin_ros.report import diagnosis_pictures as drawn
from signlin_ros.report import pictures
from signlin_ros.report.comparison import (
    OVER_TIME,
    drawing,
    findings,
    foot,
    name_of,
    names_of,
    notes,
    number,
    reproduce,
    rows_table,
    where,
)
from signlin_ros.report.files import write_report
from signlin_ros.report.formulas import formula
from signlin_ros.report.page import Block, Code, Fold, Items, Page, Picture, ReportTable, Section, Text

Records = ModelData | Sequence[ModelData]
BADGES = {"missing": "an effect is missing", "adequate": "nothing is missing", "unexplained": "unexplained"}


def diagnosis_report(
    diagnosis: Diagnosis,
    path: str | Path,
    command: str = "",
    data: tuple[Records, Records | None] | None = None,
    model: Model | None = None,
    comparisons: tuple[Comparison, Comparison] | None = None,
    record: Sequence[Finding] = (),
    first: Sequence[Section] = (),
) -> Path:
    """Write the report on a diagnosis, or on what `add` or `refine` did, and its pictures beside it; return the path.

    ``data``: the records of the fit, and those for validation (None: the last third was held out); ``model``: the base
    model as given. Both models are compared with the validation data for the report, unless ``comparisons`` (before
    and after) are given. ``command``: the command line that leads to it; ``record``: what was found in the records;
    ``first``: sections before all others.
    Raises `InputError` where it cannot be written.
    """
    d, remarks = diagnosis, list(diagnosis.notes)
    if comparisons is None and data is not None and model is not None:
        comparisons = _compared(model, d.model, *data, remarks)
    base = model or (d.findings.base if d.findings else None)
    before = comparisons[0] if comparisons else None
    sections = [
        *first,
        Section("The record", findings(record)),
        Section("What the record shows", _shown(d)),
        Section("The error, step by step", _ladder(d)),
        Section("Before and after", _before_and_after(d, comparisons)),
        Section("Where the model as given fails", _fails(before)),
        Section("Where the proposal still fails", _still(d, comparisons)),
        Section("Parameters", _parameters(d, base)),
        Section("What else was tried", _others(d)),
        Section("What this record cannot tell", _unknown(d)),
        Section("Notes", notes(remarks, record)),
        Section("To reproduce", _reproduce(d, command)),
    ]
    title = f"Diagnosis of {name_of((base or d.model).source)}" + _with(d)
    page = Page(title, (d.verdict, BADGES.get(d.verdict, d.verdict)), d.sentence, sections, foot())
    return write_report(page, path)


def _with(d: Diagnosis) -> str:
    """Return which data it is about."""
    if d.findings is None:
        return ""
    fitted, seen = (names_of(sources) for sources in (d.findings.training, d.findings.validation))
    if d.model.plant.closed_loop and fitted == seen:
        return f": fitted to {fitted}, which were held out in turn"
    return f": fitted to {fitted}, " + ("checked on its last third" if fitted == seen else f"checked on {seen}")


def _compared(
    base: Model, proposal: Model, data: Records, validation: Records | None, remarks: list[str]
) -> tuple[Comparison, Comparison] | None:
    """Return both models held against data that the fit did not see; a remark where that does not work."""
    first, second = ([d] if isinstance(d, ModelData) else list(d or []) for d in (data, validation))
    whole = base.plant.closed_loop and not second  # a loop settles: its last third says little
    unseen = first if whole else second or held_out(first)[1]
    if whole:
        remarks.append(
            "before and after are of the records that the proposal was fitted to; the steps of its errors not"
        )
    try:
        return compare(base, unseen), compare(proposal, unseen)
    except SignlinError as error:
        remarks.append(f"before and after are not shown: {error}")
        return None


# -------------------------------------------------------------------- evidence


def _shown(d: Diagnosis) -> list[Block]:
    """Return the evidence section of each named effect; where there is none, of the best that was tried."""
    blocks: list[Block] = []
    for entry in d.missing:
        likeness = "" if entry.status in ("confirmed", "ambiguous") else ": a likeness, not the cause"
        name = capitalised(printed_name(entry.effect))
        blocks += [Text(f"{name}{likeness}", "head"), formula(entry.effect, d.model)]
        blocks += [Text(f"{entry.why[:1].upper()}{entry.why[1:]}."), *_tie(entry), *_evidence(d, entry)]
    if not d.missing and d.verdict == "unexplained":
        blocks += _nearest(d)
    return blocks


def _tie(entry: RankingEntry) -> list[Block]:
    if not entry.indistinguishable_from:
        return []
    names = drawn.words(entry.indistinguishable_from).replace(" + ", ", ")
    return [Text(f"A tie: {names} would explain this record as well. See what this record cannot tell, below.", "note")]


def evidence_blocks(d: Diagnosis, effect: str) -> list[Block]:
    """Return the picture of an effect that was added; none where no force shows it."""
    found = d.findings.effects.get(effect) if d.findings else None
    return [_picture(found, effect)] if found else []


def _evidence(d: Diagnosis, entry: RankingEntry) -> list[Block]:
    found = d.findings.effects.get(entry.effect) if d.findings else None
    return [_picture(found, entry.effect)] if found else []


def _nearest(d: Diagnosis) -> list[Block]:
    """Return the picture of the best effect that did not make it."""
    name = d.findings.nearest if d.findings else ""
    found = d.findings.effects.get(name) if d.findings else None
    if found is None:
        return []
    text = f"The nearest of the listed effects is {printed_name(name)}; it does not explain the residual."
    return [Text(text), _picture(found, name)]


def _picture(e: EffectEvidence, effect: str) -> Picture:
    place = e.place.name.split(" [", maxsplit=1)[0]
    name, source = printed_name(effect), names_of(e.sources)
    caption = (
        f"Left: the force that the measured motion takes beyond the model without {name}, over {place}; in blue, the"
        f" same computed with it. {_second(e)}"
        + ("" if e.place.single else "Right: what each curve leaves of the means; around zero if it is right. ")
        + f"{_fits(e)}Data: {source}, which the fit never saw; low-pass of {e.cutoff:.3g} Hz on both."
    )
    return Picture(f"evidence_{effect}", drawn.evidence_picture(e), caption, f"missing force over {place}, {name}")


def _second(e: EffectEvidence) -> str:
    if e.rival is None:
        return ""
    if not e.rival.effect:
        return "Beside it: the same with nothing in its place, all other parameters fitted anew. "
    return f"Beside it: the same with {printed_name(e.rival.effect)} instead, all parameters fitted anew. "


def _fits(e: EffectEvidence) -> str:
    """Return the parameters of what is shown, as fitted."""
    shown = [x for x in (e.named, e.rival) if x is not None and x.parameters]
    return "".join(f"Fitted {printed_name(x.effect)}: {_values(x.parameters)}. " for x in shown)


# -------------------------------------------------------------------- errors


def _ladder(d: Diagnosis) -> list[Block]:
    caption = (
        "RMS error of every channel on data that the fit never saw, in brackets over the noise of its sensor. The"
        " dashed line is that noise: no model can be better. Refitted: base parameters fitted beside what is known."
    )
    named = [(drawn.words(rung.effects) or REFITTED_ROW, rung) for rung in d.ladder]
    table = rows_table([*([(AS_GIVEN, d.given)] if d.given else []), *named], lambda name: _unit(d, name))
    return [Picture("ladder", drawn.ladder(d), caption, "bars of the error from the base model to the noise"), table]


def _before_and_after(d: Diagnosis, comparisons: tuple[Comparison, Comparison] | None) -> list[Block]:
    if comparisons is None:
        return []
    how = f"predicted over windows of {comparisons[0].horizon:.3g} s"
    caption = (
        f"Every channel as measured, and as {how} by the model as given and by the proposal;"
        " the middle column is enlarged where the former is worst."
        " Right: the errors; grey is the noise (± 2 standard deviations)."
        f" Data: {names_of(comparisons[0].sources)}, which the fit never saw."
    )
    figure = drawn.before_and_after(*comparisons)
    return [Picture("before_and_after", figure, caption, "measured and predicted, before and after")]


def _fails(before: Comparison | None) -> list[Block]:
    """Return where the base model fails: the situations with the stretches shaded, and what its equations lack."""
    if before is None:
        return []
    blocks = where(before)
    if any(region.mask for region in before.where):
        caption = (
            "The model as given; the first situation of the table is shaded. Orange: simulated from the start; blue:"
            " predicted over windows."
        )
        blocks += drawing("where_it_fails", pictures.measured_and_simulated, caption, before)
    force = "What its equations lack, against each coordinate; the band is the mean with two standard errors."
    blocks += drawing("missing_force", pictures.missing_against, force, before)
    return blocks + drawing("missing_over_time", pictures.missing_over_time, OVER_TIME, before)


def _still(d: Diagnosis, comparisons: tuple[Comparison, Comparison] | None) -> list[Block]:
    """Return where the proposal still fails, and how what it lacks looks where that is more than noise."""
    if comparisons is None or not d.ladder[-1].effects:
        return []
    after, blocks = comparisons[1], where(comparisons[1])
    if any(m.clear for m in after.missing):
        caption = "What the proposal's equations lack, against each coordinate."
        blocks += drawing("still_missing_force", pictures.missing_against, caption, after)
        blocks += drawing("still_missing_over_time", pictures.missing_over_time, OVER_TIME, after)
        blocks += drawing("still_missing_map", pictures.error_map, "The same over two coordinates at once.", after)
    return blocks


# -------------------------------------------------------------------- parameters, rivals, limits


def _parameters(d: Diagnosis, base: Model | None) -> list[Block]:
    columns = [d.base, d.parameters]
    rows = []
    for name in dict.fromkeys([*d.parameters, *d.base]):
        before, after = (column.get(name) for column in columns)
        known = after or before
        shown = [_given(base, name, known) if known else "-", *(str(e) if e else "-" for e in (before, after))]
        rows.append([name, *shown, after.note if after else ""])
    if d.findings:
        rows += [[name, *[str(e)] * 3, e.note] for name, e in d.findings.held.items()]
    head = ["parameter", "as given", "refitted", "proposal", ""]
    text = "± is one standard error; it allows for what correlation is left in the residual."
    return [ReportTable(head, rows), Text(text, "note")]


def _given(base: Model | None, name: str, e: ParameterEstimate) -> str:
    """Return a parameter as in the model file."""
    value = numbers(base).get(name) if base else None
    return "-" if value is None else str(replace(e, value=value, std=None))


def _others(d: Diagnosis) -> list[Block]:
    """Return everything that was tried and did not make it, folded away; what does not apply in one line."""
    rest = [e for e in d.ranking if e not in d.missing and e.status != "not_applicable"]
    outside = [printed_name(e.effect) for e in d.ranking if e.status == "not_applicable"]
    blocks: list[Block] = [Items([(_status(e), e.why) for e in rest if e.status == "ambiguous"])] if rest else []
    rows = [[printed_name(e.effect), e.status.replace("_", " "), _worst(e), e.why, _values(e.parameters)] for e in rest]
    head = ["effect", "status", "error over noise", "why", "fitted"]
    if rows:
        blocks.append(Fold(f"{len(rows)} other effects, best first", [ReportTable(head, rows, right=(2,))]))
    if rows and outside:
        blocks.append(Text(f"Not applicable to this plant: {', '.join(outside)}.", "note"))
    return [b for b in blocks if not (isinstance(b, Items) and not b.items)]


def _status(e: RankingEntry) -> str:
    return f"{printed_name(e.effect)} ({e.status})"


def _worst(e: RankingEntry) -> str:
    return number(e.validation.over_noise) if e.validation else "-"


def _values(parameters: Mapping[str, ParameterEstimate]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in parameters.items())


def _unknown(d: Diagnosis) -> list[Block]:
    """Return the range that was visited, ties, what was not excited, and experiments that would decide."""
    rows = [[n, _unit(d, n), number(low), number(high)] for n, (low, high) in d.range.items()]
    blocks: list[Block] = [
        Text("The records of the fit visited this range; beyond it nothing is known, of the proposal either."),
        ReportTable(["", "unit", "from", "to"], rows, right=(2, 3)),
    ]
    ties = [(e.effect, e.indistinguishable_from) for e in d.missing if e.indistinguishable_from]
    quiet = [(printed_name(e.effect), e.why) for e in d.ranking if e.status == "not_excited"]
    if ties:
        items = [(printed_name(a), f"as good by this record: {drawn.words(b).replace(' + ', ', ')}") for a, b in ties]
        blocks += [Text("Ties", "head"), Items(items)]
    if quiet:
        blocks += [Text("Effects that this record would not show", "head"), Items(quiet)]
    if d.experiments:
        blocks += [Text("What to record to find out", "head"), Items([("", e) for e in d.experiments])]
    return blocks


def _unit(d: Diagnosis, name: str) -> str:
    """Return the unit of a state or an input, as the records have it."""
    if d.findings is None:
        return d.model.units.get(name, "")
    return d.findings.shown(d.findings.units.get(name, ""))


def _reproduce(d: Diagnosis, command: str) -> list[Block]:
    blocks = reproduce(command)
    if d.yaml:
        run = "ros2 run signlin_ros linearizer --ros-args --params-file proposal.yaml"
        text = "The proposal as a model file, for the command line and for the linearizer node alike:"
        blocks += [Text(text), Code(d.yaml), Text("Save it as proposal.yaml, and the linearizer runs with it:")]
        blocks.append(Code(run))
        said = "In a simulator or another tool it is run there, on a record, and what is lost is measured:"
        log = Path(d.findings.training[0]).name if d.findings and d.findings.training else "RECORD"
        ways = "other targets: c, fmu, bam, isaaclab, urdf, casadi ... (signlin export --help)"
        blocks += [Text(said), Code(f"signlin export proposal.yaml --to mjcf -o proposal.xml --data {log}"), Text(ways)]
    return blocks


__all__ = ["diagnosis_report"]
