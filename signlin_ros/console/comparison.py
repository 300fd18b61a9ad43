"""Findings about records and comparisons with them as text, and the rows of errors that every verb shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from signlin_ros.console.tables import short, table
from signlin_ros.digits import with_error
from signlin_ros.names import AS_GIVEN, MISSING_FORCE_ROW, REFITTED_ROW, SENSOR_NOISE_ROW, printed_name


def check_text(content: dict[str, Any]) -> str:
    """Return the findings in records as text, one line each, or that there are none."""
    return _record(content) or "nothing is wrong with the record that any check looks for"


def _record(content: dict[str, Any] | None) -> str:
    """Return findings as lines by record; nothing where there are none."""
    findings = content["findings"] if content else []
    lines = []
    for source in dict.fromkeys(f["record"] for f in findings):
        lines.append(f"about the record {source}")
        lines += [f"  {_said(f)}" for f in findings if f["record"] == source]
    return "\n".join(lines)


def _said(f: dict[str, Any]) -> str:
    cure = f" [--cure {f['cure']}{': applied' if f['applied'] else ''}]" if f["cure"] else ""
    return f"{f['severity']}: {f['check']}: {f['sentence']}{cure}"


def compare_text(content: dict[str, Any]) -> str:
    """Return a comparison as text: scores, what is missing, where it fails, what is left in the residual."""
    data = content["data"]
    records = data[0] if len(data) == 1 else f"{len(data)} records"
    parts = [f"{content['model']} against {records}, {content['samples']} samples", _record(content.get("record"))]
    parts += [_first_rows(content), _scores(content)]
    parts += [_inverse(content["inverse"]), _missing(content["missing"]), _where(content["where"])]
    parts += [_residuals(content["residual_tests"]), _notes(content)]
    return "\n\n".join(part for part in parts if part)


def diagnosis_text(content: dict[str, Any]) -> str:
    """Return a diagnosis as text: verdict, what is missing and why, the ladder of the error, parameters."""
    parts = [f"{content['verdict'].upper()}: {content['sentence']}", _record(content.get("record"))]
    parts += [_ladder(content), _named(content)]
    parts += [_fitted(content["parameters"], content["base"]["parameters"]), _notes(content)]
    return "\n\n".join(part for part in parts if part)


def _notes(content: dict[str, Any]) -> str:
    """Return the notes as lines, without those that are among the findings about the record."""
    record = content.get("record") or {"findings": []}
    told = {f"{f['record']}: {f['sentence']}" for f in record["findings"]}
    return "\n".join(f"note: {note}" for note in dict.fromkeys(content["notes"]) if note not in told)


ERRORS = ("", "", "training", "/ noise", "validation", "fit", "/ noise")
"""Columns of the rows by which models are told apart."""


def _ladder(content: dict[str, Any]) -> str:
    return _errors(ladder_rows(content), content["horizon"])


def _first_rows(content: dict[str, Any]) -> str:
    rows = first_rows(content)
    return _errors(rows, content["first_rows"]["horizon"]) if rows else ""


AT_BEST = f"{MISSING_FORCE_ROW}: of validation data; {REFITTED_ROW}: base parameters fitted to training data"
"""Of which data the force is told, and for which values: what is fitted to training data may leave more of validation
data."""


def _errors(rows: list[list[str]], horizon: float) -> str:
    shown = f"Error over the next {horizon:.3g} s (RMS)\n" + table([ERRORS, *rows], right=range(2, 7))
    return f"{shown}\n({AT_BEST})" if any(row[1] == MISSING_FORCE_ROW for row in rows) else shown


def first_rows(content: dict[str, Any]) -> list[list[str]]:
    """Return the first rows of a comparison, none where it has none."""
    found = content.get("first_rows")
    return error_rows([(AS_GIVEN, found["given"]), (REFITTED_ROW, found["refitted"])]) if found else []


def ladder_rows(content: dict[str, Any]) -> list[list[str]]:
    """Return the rows of a diagnosis: the model as given, refitted, then with one effect more in each group."""
    given, ladder = content["given"], content["ladder"]
    first = [(AS_GIVEN, given), (REFITTED_ROW, ladder[0])] if given else [(AS_GIVEN, ladder[0])]
    return error_rows([*first, *((" + ".join(rung["effects"]), rung) for rung in ladder[1:])])


def error_rows(groups: Sequence[tuple[str, dict[str, Any]]]) -> list[list[str]]:
    """Return rows of `ERRORS`, a group for each name and rung: a row for each channel and one for the force that is
    missing, in per cent of the effort. The noise of the sensors is the last group.
    """
    rows = []
    for name, rung in groups:
        own = [_error_row(c, rung["estimation"][c], s) for c, s in rung["validation"].items() if c != "score"]
        if rung["missing_force_percent"] is not None:
            over = rung.get("missing_force_over_noise")
            left = f"{short(rung['missing_force_percent'])} %"
            own.append([MISSING_FORCE_ROW, "-", "-", left, "-", "-" if over is None else short(over)])
        rows += [[name if k == 0 else "", *row] for k, row in enumerate(own)]
    floor: dict[str, str] = {}
    for _, rung in groups:
        floor = _floor(rung) | floor
    return rows + [[SENSOR_NOISE_ROW if k == 0 else "", c, "", "", x, "", ""] for k, (c, x) in enumerate(floor.items())]


def _error_row(channel: str, fitted: dict[str, Any], unseen: dict[str, Any]) -> list[str]:
    before = _score(fitted)
    return [channel, before[0], before[2], *_score(unseen)]


def _floor(rung: dict[str, Any]) -> dict[str, str]:
    """Return the noise of the sensors by channel and of the force, as far as a rung tells of it."""
    scores = [(c, s["rmse"], s["rmse_over_noise"], "") for c, s in rung["validation"].items() if c != "score"]
    scores.append((MISSING_FORCE_ROW, rung["missing_force_percent"], rung.get("missing_force_over_noise"), " %"))
    return {c: f"{short(x / over)}{unit}" for c, x, over, unit in scores if x is not None and over}


def _named(content: dict[str, Any]) -> str:
    shown = [e for e in content["ranking"] if e["status"] in ("confirmed", "ambiguous")]
    proposed = content["ladder"][-1]["effects"]
    shown = [e for e in shown if e["effect"] in proposed or not {*e["indistinguishable_from"]} & {*proposed}]
    shown += [e for e in content["ranking"] if e["effect"] in proposed and e not in shown]
    best = [e for e in content["ranking"] if e["status"] == "rejected" and e not in shown][:3]
    unseen = [e["effect"] for e in content["ranking"] if e["status"] == "not_excited"]
    part = content["verdict"] == "unexplained"
    words = {"confirmed": "explains a part", "rejected": "not confirmed"} if part else {}
    lines = [f"{e['effect']}: {words.get(e['status'], e['status'])}\n    {e['why']}{_in_place(e)}" for e in shown]
    lines += [f"{e['effect']}: {e['status']}\n    {e['why']}" for e in best]
    if unseen:
        lines.append(f"this record cannot tell: {', '.join(unseen)}")
    ties = {printed_name(t) for e in shown for t in (e["effect"], *e["indistinguishable_from"])}
    lines += [text for text in content["experiments"] if any(f"to decide on {t}:" in text for t in ties)]
    return "\n".join(lines)


def _in_place(entry: dict[str, Any]) -> str:
    """Return a line on the effects that are as good in the place of one; empty where none is."""
    names = ", ".join(printed_name(t) for t in entry["indistinguishable_from"])
    told = "as good in its place" if entry["status"] == "ambiguous" else "richer laws that do no better"
    return f"\n    {told}: {names}" if names else ""


def _fitted(parameters: dict[str, Any], base: dict[str, Any]) -> str:
    """Return the parameters of the proposal, and those of the refitted base of which there is something to say."""
    rows = [["parameter", "value", "±", "unit", ""]]
    odd = {n: p for n, p in base.items() if "tolerances" in p.get("note", "") and parameters.get(n) != p}
    for name, p in {**parameters, **{f"{n}, refitted": p for n, p in odd.items()}}.items():
        value, error = with_error(p["value"], p["std"])
        rows.append([name, value, error or "-", "" if p["unit"] == "-" else p["unit"], p.get("note", "")])
    return table(rows, right=(1, 2)) if rows[1:] else ""


def _scores(content: dict[str, Any]) -> str:
    """Return scores of all records together; over windows only where the first rows do not show that."""
    first = content.get("first_rows")
    ahead = "" if first and first["horizon"] == content["horizon"] else f"next {content['horizon']:.3g} s"
    rows = [["", "unit", "noise", "free run", "fit", "/ noise", *([ahead, "fit", "/ noise"] if ahead else [])]]
    for name, c in content["channels"].items():
        windowed = _score(c["windowed"]) if ahead else []
        rows.append([name, c["unit"], short(c["noise"]), *_score(c["free_run"]), *windowed])
    return "RMS errors, all samples\n" + table(rows, right=range(2, 9))


def _score(score: dict[str, Any] | None) -> list[str]:
    if score is None:
        return ["-", "-", "-"]
    fit = "-" if score["fit_percent"] is None else f"{score['fit_percent']:.1f} %"
    if score["rmse"] is None:
        return ["diverges", "-", "-"]
    return [short(score["rmse"]), fit, "-" if score["rmse_over_noise"] is None else short(score["rmse_over_noise"])]


def _inverse(found: dict[str, Any]) -> str:
    if not found:
        return ""
    ((name, i),) = found.items()
    share = "-" if i["relative_error_percent"] is None else f"{i['relative_error_percent']:.3g} %"
    how = f"low-pass {i['cutoff_hz']:g} Hz" + (f", one sample in {i['decimation']}" if i["decimation"] > 1 else "")
    return f"{name} computed from the motion: {short(i['rmse'])} {i['unit']} off, {share} of the measured ({how})"


def _missing(found: dict[str, Any]) -> str:
    rows = [["", "RMS", "of the usual", "forward", "backward", ""]]
    for name, m in found.items():
        if m["clear"]:
            sides = [f"{m[s]['mean']:.3g} ± {2 * m[s]['std']:.1g}" if s in m else "-" for s in ("forward", "backward")]
            rows.append([name, short(m["rms"]), f"{short(100 * m['rms'] / m['typical'])} %", *sides, m["unit"]])
    if not rows[1:]:
        return ""
    return "missing from the equations (means ± 2 standard errors)\n" + table(rows, right=[1, 2, 3, 4])


def _where(regions: Sequence[dict[str, Any]]) -> str:
    rows = [["where it fails", "of the error", "of the time"]]
    rows += [[r["region"], *(f"{r[f'share_of_{k}_percent']:.0f} %" for k in ("error", "time"))] for r in regions]
    return table(rows, right=[1, 2]) if regions else ""


def _residuals(tests: dict[str, Any]) -> str:
    rows = [["residual", "lag 1", "white", "follows the input"]]
    yes = {True: "yes", False: "no"}
    rows += [[n, f"{t['lag1']:.2f}", yes[t["white"]], yes[t["input_correlated"]]] for n, t in tests.items()]
    return table(rows, right=[1])


__all__ = ["ERRORS", "check_text", "compare_text", "diagnosis_text", "error_rows", "first_rows", "ladder_rows"]
