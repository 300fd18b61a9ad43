"""What the command line says: results as plain mappings (see ``schemas/``) and as aligned text with units."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.compiled import surface_scales, weights
from signlin_ros.digits import with_error
from signlin_ros.linearize import Linearization
from signlin_ros.model import Model
from signlin_ros.names import AS_GIVEN, FORCE, REFITTED, SENSORS
from signlin_ros.records import ModelData, Record, Signal
from signlin_ros.sign import valid_reach
from signlin_ros.simulate import Trajectory


def table(rows: Iterable[Sequence[str]], indent: str = "  ", right: Sequence[int] = ()) -> str:
    """Return rows of cells as aligned columns; those in ``right`` are set flush right."""
    cells = [list(row) for row in rows]
    widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))] if cells else []

    def line(row: list[str]) -> str:
        pairs = enumerate(zip(row, widths, strict=True))
        return "  ".join(cell.rjust(width) if i in right else cell.ljust(width) for i, (cell, width) in pairs)

    return "\n".join((indent + line(row)).rstrip() for row in cells)


def _number(value: float) -> str:
    return f"{value:.6g}"


# -------------------------------------------------------------------- linearize


def linearize_content(model: Model, result: Linearization) -> dict[str, Any]:
    """Return a linearization as the JSON object of schemas/linearize.json."""
    arrays = {name: getattr(result, name).tolist() for name in ("A", "B", "c", "x", "u", "f")}
    return arrays | {
        "states": list(model.states),
        "inputs": list(model.inputs),
        "method": result.method,
        "sign_order": model.sign_order,
        "sign_scale": surface_scales(model),
        "in_valid_range": result.in_valid_range,
        "delay": result.delay,
    }


def linearize_warnings(model: Model, result: Linearization) -> list[str]:
    """Return what a user of this linear model should know: outside the valid range, position in the norm."""
    found = []
    if not result.in_valid_range:
        limit = valid_reach(model.sign_order)
        limits = ", ".join(f"|{name}| <= {scale * limit:.4g}" for name, scale in surface_scales(model).items())
        found.append(
            f"the operating point is outside the valid range of sign_j at order {model.sign_order}: {limits};"
            " raise sign_scale or sign_order, or set sign_scale: 0.0 with an operating_range"
        )
    position = model.plant.position
    if (
        result.method == "optimal"
        and position in model.states
        and weights(model)[model.states.index(position)] > 0
        and model.parameters.get("k", 0.0) == 0.0
    ):
        found.append(
            f"{position} carries weight in the optimal linearization, so A depends on where {position} is 0;"
            f" state_weights: {{{position}: 0.0}} in the model file takes it out"
        )
    return found


def linearize_text(model: Model, content: dict[str, Any]) -> str:
    """Return a linearization as text: the operating point with units, then A, B and c with their names."""
    c, states, inputs, units = content, content["states"], content["inputs"], model.units
    scale = ", ".join(f"{name}: {value:g}" for name, value in content["sign_scale"].items()) or "no surfaces"
    head = [
        f"x' = A x + B u + c   {model.plant.name} ({model.source})",
        f"method {content['method']}, sign_order {content['sign_order']}, sign_scale {{{scale}}}",
        f"{'inside' if c['in_valid_range'] else 'OUTSIDE'} the valid range; delay {c['delay']:g} s",
    ]
    point = [["", "value", "", "f"]]
    point += [
        [n, _number(v), units[n], f"{_number(f)} {per_second(units[n])}"]
        for n, v, f in zip(states, content["x"], content["f"], strict=True)
    ]
    point += [[n, _number(v), units[n], ""] for n, v in zip(inputs, content["u"], strict=True)]
    matrices = [
        _matrix("A", states, states, content["A"]),
        _matrix("B", states, inputs, content["B"]),
        _matrix("c", states, [""], [[value] for value in content["c"]]),
    ]
    return "\n\n".join(["\n".join(head), "operating point\n" + table(point, right=[1]), *matrices])


def per_second(unit: str) -> str:
    """Return the unit of a rate of change."""
    return {"-": "1/s", "m/s": "m/s²", "rad/s": "rad/s²"}.get(unit, f"{unit}/s")


def _matrix(name: str, rows: Sequence[str], columns: Sequence[str], values: list[list[float]]) -> str:
    cells = [["", *columns]] if any(columns) else []
    cells += [[row, *map(_number, line)] for row, line in zip(rows, values, strict=True)]
    return f"{name}\n" + table(cells, right=range(1, len(columns) + 1))


# -------------------------------------------------------------------- simulate


def trajectory_record(model: Model, run: Trajectory, source: str) -> Record:
    """Return a run as a record: inputs, states, outputs, each name once."""
    names = dict.fromkeys((*run.inputs, *run.states, *run.outputs))
    return Record(run.t, {name: Signal(run[name], model.units[name]) for name in names}, source)


def simulate_content(
    model: Model, data: ModelData, run: Trajectory, kind: str, rtol: float, output: str
) -> dict[str, Any]:
    """Return the summary of a simulation, without its samples."""
    names = dict.fromkeys((*run.inputs, *run.states, *run.outputs))
    counts = Counter((surface, what) for _, surface, what in run.events)
    return {
        "output": output,
        "as": kind,
        "rtol": rtol,
        "samples": len(run.t),
        "start": float(run.t[0]),
        "end": float(run.t[-1]),
        "states": list(run.states),
        "inputs": list(run.inputs),
        "outputs": list(run.outputs),
        "initial_state": dict(zip(run.states, run.x[0].tolist(), strict=True)),
        "initial_state_from": "model" if data.x0 is None else "data",
        "final_state": dict(zip(run.states, run.x[-1].tolist(), strict=True)),
        "channels": {name: _channel(run[name], model.units[name]) for name in names},
        "events": [{"surface": s, "what": what, "count": n} for (s, what), n in sorted(counts.items())],
        "notes": list(data.notes),
    }


def _channel(values: NDArray[np.float64], unit: str) -> dict[str, Any]:
    rms = float(np.sqrt(np.mean(values**2)))
    return {"unit": unit, "low": float(np.min(values)), "high": float(np.max(values)), "rms": rms}


def simulate_text(content: dict[str, Any]) -> str:
    """Return the summary of a simulation as text."""
    origin = {"model": "the model's initial_state", "data": "the first row of the data"}
    rows = [["", "unit", "from", "to", "RMS"]]
    rows += [
        [name, c["unit"], *(_number(c[key]) for key in ("low", "high", "rms"))]
        for name, c in content["channels"].items()
    ]
    events = [[e["surface"], e["what"], f"{e['count']}x"] for e in content["events"]]
    head = (
        f"{content['output']}: {content['samples']} samples, {content['start']:g} s to {content['end']:g} s,"
        f" as {content['as']}, from {origin[content['initial_state_from']]}"
    )
    parts = [head, table(rows, right=[2, 3, 4])]
    return "\n\n".join(parts + (["surfaces\n" + table(events)] if events else []))


# -------------------------------------------------------------------- check


def check_text(content: dict[str, Any]) -> str:
    """Return what was found in records as text, one line each, or that nothing was."""
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


# -------------------------------------------------------------------- compare


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
    parts += [_fitted(content["parameters"]), _notes(content)]
    return "\n\n".join(part for part in parts if part)


def _notes(content: dict[str, Any]) -> str:
    """Return the notes as lines, without those that are among the findings about the record."""
    record = content.get("record") or {"findings": []}
    told = {f"{f['record']}: {f['sentence']}" for f in record["findings"]}
    return "\n".join(f"note: {note}" for note in dict.fromkeys(content["notes"]) if note not in told)


ERRORS = ("", "", "fitted to", "/ noise", "unseen", "fit", "/ noise")
"""Columns of the rows by which models are told apart."""


def _ladder(content: dict[str, Any]) -> str:
    return _errors(ladder_rows(content), content["horizon"])


def _first_rows(content: dict[str, Any]) -> str:
    rows = first_rows(content)
    return _errors(rows, content["first_rows"]["horizon"]) if rows else ""


def _errors(rows: list[list[str]], horizon: float) -> str:
    return f"Error over the next {horizon:g} s (RMS)\n" + table([ERRORS, *rows], right=range(2, 7))


def first_rows(content: dict[str, Any]) -> list[list[str]]:
    """Return the first rows of a comparison, none where it has none."""
    found = content.get("first_rows")
    return error_rows([(AS_GIVEN, found["given"]), (REFITTED, found["refitted"])]) if found else []


def ladder_rows(content: dict[str, Any]) -> list[list[str]]:
    """Return the rows of a diagnosis: the model as given, refitted, then with one effect more in each group."""
    given, ladder = content["given"], content["ladder"]
    first = [(AS_GIVEN, given), (REFITTED, ladder[0])] if given else [(AS_GIVEN, ladder[0])]
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
            left = f"{_short(rung['missing_force_percent'])} %"
            own.append([FORCE, "-", "-", left, "-", "-" if over is None else _short(over)])
        rows += [[name if k == 0 else "", *row] for k, row in enumerate(own)]
    floor: dict[str, str] = {}
    for _, rung in groups:
        floor = _floor(rung) | floor
    return rows + [[SENSORS if k == 0 else "", c, "", "", x, "", ""] for k, (c, x) in enumerate(floor.items())]


def _error_row(channel: str, fitted: dict[str, Any], unseen: dict[str, Any]) -> list[str]:
    before = _score(fitted)
    return [channel, before[0], before[2], *_score(unseen)]


def _floor(rung: dict[str, Any]) -> dict[str, str]:
    """Return the noise of the sensors by channel and of the force, as far as a rung tells of it."""
    scores = [(c, s["rmse"], s["rmse_over_noise"], "") for c, s in rung["validation"].items() if c != "score"]
    scores.append((FORCE, rung["missing_force_percent"], rung.get("missing_force_over_noise"), " %"))
    return {c: f"{_short(x / over)}{unit}" for c, x, over, unit in scores if x is not None and over}


def _named(content: dict[str, Any]) -> str:
    shown = [e for e in content["ranking"] if e["status"] in ("confirmed", "ambiguous")]
    proposed = content["ladder"][-1]["effects"]
    shown += [e for e in content["ranking"] if e["effect"] in proposed and e not in shown]
    best = [e for e in content["ranking"] if e["status"] == "rejected" and e not in shown][:3]
    unseen = [e["effect"] for e in content["ranking"] if e["status"] == "not_excited"]
    lines = [f"{e['effect']}: {e['status']}\n    {e['why']}" for e in (*shown, *best)]
    if unseen:
        lines.append(f"this record cannot tell: {', '.join(unseen)}")
    ties = [e["effect"].replace("_", " ") for e in content["ranking"] if e["status"] == "ambiguous"]
    lines += [text for text in content["experiments"] if any(f"to decide on {t}:" in text for t in ties)]
    return "\n".join(lines)


def _fitted(parameters: dict[str, Any]) -> str:
    rows = [["parameter", "value", "±", "unit", ""]]
    for name, p in parameters.items():
        value, error = with_error(p["value"], p["std"])
        rows.append([name, value, error or "-", "" if p["unit"] == "-" else p["unit"], p.get("note", "")])
    return table(rows, right=(1, 2)) if rows[1:] else ""


def _scores(content: dict[str, Any]) -> str:
    """Return scores of all records together; over windows only where the first rows do not show that."""
    first = content.get("first_rows")
    ahead = "" if first and first["horizon"] == content["horizon"] else f"next {content['horizon']:g} s"
    rows = [["", "unit", "noise", "free run", "fit", "/ noise", *([ahead, "fit", "/ noise"] if ahead else [])]]
    for name, c in content["channels"].items():
        windowed = _score(c["windowed"]) if ahead else []
        rows.append([name, c["unit"], _short(c["noise"]), *_score(c["free_run"]), *windowed])
    return "RMS errors, all samples\n" + table(rows, right=range(2, 9))


def _score(score: dict[str, Any] | None) -> list[str]:
    if score is None:
        return ["-", "-", "-"]
    fit = "-" if score["fit_percent"] is None else f"{score['fit_percent']:.1f} %"
    if score["rmse"] is None:
        return ["diverges", "-", "-"]
    return [_short(score["rmse"]), fit, "-" if score["rmse_over_noise"] is None else _short(score["rmse_over_noise"])]


def _short(value: float) -> str:
    return f"{value:.0f}" if 1000 <= abs(value) < 1e7 else f"{value:.3g}"


def _inverse(found: dict[str, Any]) -> str:
    if not found:
        return ""
    ((name, i),) = found.items()
    share = "-" if i["relative_error_percent"] is None else f"{i['relative_error_percent']:.3g} %"
    how = f"low-pass {i['cutoff_hz']:g} Hz" + (f", one sample in {i['decimation']}" if i["decimation"] > 1 else "")
    return f"{name} computed from the motion: {_short(i['rmse'])} {i['unit']} off, {share} of the measured ({how})"


def _missing(found: dict[str, Any]) -> str:
    rows = [["", "RMS", "of the usual", "forward", "backward", ""]]
    for name, m in found.items():
        if m["clear"]:
            sides = [f"{m[s]['mean']:.3g} ± {2 * m[s]['std']:.1g}" if s in m else "-" for s in ("forward", "backward")]
            rows.append([name, _short(m["rms"]), f"{_short(100 * m['rms'] / m['typical'])} %", *sides, m["unit"]])
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


# -------------------------------------------------------------------- effects and plants


def effects_text(content: dict[str, Any]) -> str:
    """Return the catalogue of effects, one line each."""
    entries = content["effects"].values()
    rows = [[e["name"], e["equation"]] for e in entries]
    return "\n".join(
        [
            "Force or torque on the moving mass, v its velocity, q its position; positive accelerates.",
            "Of a sensor: y is what it shows of the true value x of a channel, a state or an output.",
            "`signlin effects NAME` shows units, bounds, plants and the source.\n",
            table([["effect", "law"], *rows], indent=""),
        ]
    )


def plants_text(content: dict[str, Any]) -> str:
    """Return the catalogue of plants, one block each."""
    return "\n\n".join(_plant(entry) for entry in content["plants"].values())


def effect_text(content: dict[str, Any]) -> str:
    """Return one effect in full."""
    (entry,) = content["effects"].values()
    states = [[name, _unit(units)] for name, units in entry["states"].items()]
    facts = [["law", entry["equation"]], ["plants", ", ".join(entry["plants"]) or "(none)"]]
    facts += [["dissipative", "yes"]] if entry["dissipative"] else []
    facts += [["source", entry["source"]]] if entry["source"] else []
    facts += [["per channel", _CHANNELS.format(**entry)]] if entry["per_channel"] else []
    blocks = [f"{entry['name']}: {entry['summary']}", table(facts), _parameters(entry)]
    return "\n\n".join(blocks + (["own states\n" + table(states)] if states else []))


_CHANNELS = "given by the names of states and outputs: {name}: {{velocity: ...}}; those not named have the default"


def plant_text(content: dict[str, Any]) -> str:
    """Return one plant in full."""
    (entry,) = content["plants"].values()
    aliases = ", ".join(f"{alias} = {name}" for alias, name in entry["aliases"].items() if name)
    facts = [
        ["aliases", aliases],
        ["method", f"{entry['linearization']} unless the model file says otherwise"],
    ]
    facts += [["source", entry["source"]]] if entry["source"] else []
    return "\n\n".join([_plant(entry), table(facts), _parameters(entry), _wrapped("effects", entry["effects"])])


def _plant(entry: dict[str, Any]) -> str:
    rows = [["equation", entry["equation"]]]
    for kind in ("states", "inputs"):
        optional = [f"({name} [{unit}])" for name, unit in entry[f"optional_{kind}"].items()]
        rows.append([kind, ", ".join([f"{n} [{unit}]" for n, unit in entry[kind].items()] + optional)])
    rows.append(["outputs", ", ".join(f"{name} [{unit}]" for name, unit in entry["outputs"].items())])
    return f"{entry['name']}: {entry['summary']}\n{table(rows)}"


def _parameters(entry: dict[str, Any]) -> str:
    rows = [["", "unit", "allowed", "nominal", "default", ""]]
    for name, par in entry["parameters"].items():
        rows.append(
            [name, _unit(par["units"]), _allowed(par), _value(par["nominal"]), _value(par["default"]), par["doc"]]
        )
    return "parameters\n" + table(rows)


def _allowed(par: dict[str, Any]) -> str:
    if par["choices"]:
        return ", ".join(map(_value, par["choices"]))
    one = f"{'(' if par['low_excluded'] else '['}{par['low']:g}, {par['high']:g}]"
    many = f"as many as {par['along']}, each in" if par["along"] else "a list, each in"
    return f"{many} {one}" if par["list"] else one


def _value(value: Any) -> str:
    """Return a number, a word or a list of these as a model file has it; - for none."""
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    return "-" if value is None else value if isinstance(value, str) else f"{value:g}"


def _unit(units: dict[str, str]) -> str:
    return " or ".join(dict.fromkeys(units.values()))


def _wrapped(title: str, names: Sequence[str]) -> str:
    lines = [""]
    for name in names:
        if len(lines[-1]) + len(name) > 96:
            lines.append("")
        lines[-1] += f"{name}, "
    return title + "\n" + "\n".join(f"  {line.rstrip()}" for line in lines).rstrip(",")
