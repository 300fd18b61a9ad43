"""The one place where the workbench meets the numerics: the functions behind the command line, as JSON.

Each verb takes plain arguments and a function that tells of progress, and returns what can be written as JSON. What the
command line prints for a verb is returned unchanged under ``json``; beside it stands what a picture needs.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from signlin_ros import console
from signlin_ros.apart import of_record
from signlin_ros.errors import InputError
from signlin_ros.filters import low_pass
from signlin_ros.model import Model, shipped_models
from signlin_ros.model.arm import ArmModel
from signlin_ros.names import printed_name
from signlin_ros.records import ModelData
from signlin_ros.workbench import arrays, planning, sheet, tuning
from signlin_ros.workbench.exporting import use
from signlin_ros.workbench.looking import columns, points, propose, record_curves, search, span
from signlin_ros.workbench.proposing import shows_angle
from signlin_ros.workbench.ranking import Ranking
from signlin_ros.workbench.uploaded import CodeError, opened

MOST_XY = 4000
"""Points of a picture of one quantity over another."""
Args = Mapping[str, Any]
Say = Callable[[dict[str, Any]], None]
Answer = dict[str, Any]


# -------------------------------------------------------------------- what is given


def ready(args: Args, say: Say) -> Answer:
    """Import what the verbs need, so that the first click does not wait for it."""
    from signlin_ros import checks, diagnosis

    return {"ready": [checks.check.__name__, diagnosis.compare.__name__]}


def load_compiled() -> None:
    """Load what calls of compiled code need, which takes a third of a second at the first call of any."""
    low_pass(np.zeros(8), 1.0, 0.1)


def reader(args: Args, say: Say) -> Answer:
    """Import what reads and thins large records, so that the first drop does not wait for it."""
    found = [name for name in ("pyarrow.csv", "tsdownsample") if find_spec(name.partition(".")[0])]
    return {"ready": [import_module(name).__name__ for name in found]}


def models(args: Args, say: Say) -> Answer:
    """Return the shipped models with what they are driven by, and forms by which a model is written."""
    return {"models": [describe({"model": name}, say) for name in shipped_models()], "forms": sheet.forms()}


def describe(args: Args, say: Say) -> Answer:
    """Return a model: its text, signals with units, parameters with bounds. ``uploaded``: it may not name any code."""
    path = str(args["model"])
    model = opened(path, dropped=bool(args.get("uploaded")))
    file = shipped_models().get(path, Path(path))
    signals = dict.fromkeys((*model.inputs, *model.states, *model.outputs))
    return {
        "name": path,
        "plant": model.plant.name,
        "summary": (model.plant.__doc__ or "").strip().split("\n")[0].replace("`", ""),
        "inputs": list(model.inputs),
        "states": list(model.states),
        "signals": {name: model.units[name] for name in signals},
        "effects": list(model.effects),
        "conditions": {name: model.parameters[name] for name in model.plant.benches if name in model.parameters},
        "parameters": tuning.parameters(model),
        "yaml": file.read_text(encoding="utf-8"),
        "file": str(file),
    }


def code(args: Args, say: Say) -> Answer:
    """Return nothing where a model names no code but what was agreed to; raises `CodeError` otherwise."""
    opened(str(args["model"]))
    return {}


# -------------------------------------------------------------------- check, compare


def _arm(args: Args) -> ArmModel | None:
    """Return the model where it is that of an arm."""
    model = opened(args["model"])
    return model if isinstance(model, ArmModel) else None


def _loaded(args: Args, files: Sequence[str]) -> tuple[Model, list[ModelData], list[Any]]:
    """Return model and records as the verbs take them, checked and cured, and what was found in them."""
    from signlin_ros.guard import check_records

    model, records = _as_read(args, files)
    validated = any(file in files for file in args.get("validation") or ())
    return model, *check_records(model, records, _cures(args), validated=validated)


def _as_read(args: Args, files: Sequence[str]) -> tuple[Model, list[ModelData]]:
    from signlin_ros.diagnosis import load_records

    model, records = load_records(opened(args["model"]), list(files), args.get("signals") or {})
    return model, list(records)


def _cures(args: Args) -> tuple[str, ...]:
    return tuple(args.get("cures") or ())


def _of(records: Sequence[ModelData], own: Sequence[str], others: Sequence[str]) -> list[ModelData]:
    """Return the records that come from some files: one file may hold several."""

    def file(record: ModelData) -> str:
        return max((f for f in (*own, *others) if record.source.startswith(f)), key=len, default="")

    return [record for record in records if file(record) in own]


def check(args: Args, say: Say) -> Answer:
    """Return the findings of the record check; ``directions``: for each, the mapping that would answer it, or None."""
    from signlin_ros import checks

    if arm := _arm(args):
        from signlin_ros.workbench import arms

        return arms.check(arm, args)
    files = [*args["data"], *args["validation"]]
    model, records = _as_read(args, files)
    _, findings = checks.check(model, records, _cures(args), validated=bool(args["validation"]))
    return {"json": checks.to_json(findings), "directions": [_direction(args, files, f) for f in findings]}


def _direction(args: Args, files: Sequence[str], finding: Any) -> dict[str, str] | None:
    """Return the mapping that gives an input its sign, where that stands in another column; None for other findings."""
    from signlin_ros.checks.direction import with_direction
    from signlin_ros.checks.unsigned_input import UnsignedInput

    if finding.check != UnsignedInput.name:
        return None
    file = max((f for f in files if finding.source.startswith(f)), key=len, default=files[0])
    signals = of_record(args.get("signals"), file)
    return with_direction(opened(args["model"]), file, signals, finding.channel)


def compare(args: Args, say: Say) -> Answer:
    """Compare, keep the curves in ``args["store"]`` (npz), return what `signlin compare --json` prints."""
    from signlin_ros.diagnosis import compare as run

    if arm := _arm(args):
        from signlin_ros.workbench import arms

        return arms.compare(arm, args, say)
    told: list[str] = []

    def tell(what: str) -> None:
        told.append(what)
        say({"what": what, "share": 1 - 0.85 ** len(told)})

    tell("reading the record")
    model, records, _ = _loaded(args, args["data"])
    result = run(model, records, progress=tell)
    parts = [_kept(trace) for trace in result.traces]
    np.savez(args["store"], **{f"{k}/{name}": v for k, part in enumerate(parts) for name, v in part.items()})
    content = result.to_json()
    return {
        "json": content,
        "lost": _lost(result, content["first_rows"]),
        "errors": _errors(console.first_rows(content)),
        "channels": {name: channel.unit for name, channel in result.channels.items()},
        "inputs": {name: result.units.get(name, "") for name in model.inputs},
        "stretches": [
            {"source": trace.source, "span": [float(trace.t[0]), float(trace.t[-1])]} for trace in result.traces
        ],
        "regions": [_intervals(result, region) for region in result.where],
    }


def _lost(result: Any, first: Any) -> list[dict[str, Any]]:
    """Return the channels that the model does not follow as given: fits (%) over windows as given, and refitted; and
    whether the refitted one follows (None: there is none).
    """
    from signlin_ros.comparison.scores import MIN_FIT_PERCENT
    from signlin_ros.diagnosis.compared import lost

    found = []
    for name in lost(result.channels):
        refitted_evidence = (first["refitted"]["validation"].get(name) or {}).get("fit_percent") if first else None
        follows = None if refitted_evidence is None else refitted_evidence >= MIN_FIT_PERCENT
        found.append({"name": name, "given": result.channels[name].windowed.fit_percent, "refitted": refitted_evidence})
        found[-1]["follows"] = follows
    return found


def _errors(rows: list[list[str]]) -> list[list[str]]:
    """Return the rows by which models are told apart, below their head."""
    return [["model", "channel", *console.ERRORS[2:]], *rows] if rows else []


def _kept(trace: Any) -> dict[str, Any]:
    return {name: getattr(trace, name) for name in ("t", "u", "measured", "free", "windowed", "residual")}


def _intervals(result: Any, region: Any) -> list[list[float]]:
    """Return where a situation holds: [stretch, from s, to s] each, the longest ones."""
    found: list[list[float]] = []
    for k, (mask, trace) in enumerate(zip(region.mask, result.traces, strict=False)):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
        pairs = zip(edges[::2], np.minimum(edges[1::2], trace.t.size) - 1, strict=True)
        found += [[k, float(trace.t[a]), float(trace.t[b])] for a, b in pairs]
    return sorted(found, key=lambda i: i[1] - i[2])[:300]


def compare_curves(args: Args, say: Say) -> Answer:
    """Return measured and simulated curves of a stretch between two times, and what is left, by channel."""
    held = np.load(args["store"])
    k, how = int(args.get("stretch") or 0), "free" if args.get("how") == "free" else "windowed"
    t, measured, simulated = (held[f"{k}/{name}"] for name in ("t", "measured", how))
    also = [other[f"{k}/{how}"] for other in map(np.load, args.get("also") or ()) if f"{k}/{how}" in other]
    plots = []
    for j, (name, unit) in enumerate(args["channels"].items()):
        curves = {
            "measured": measured[:, j],
            "simulated": simulated[:, j],
            **{f"also{i}": one[:, j] for i, one in enumerate(also) if one.shape == simulated.shape},
            "residual": measured[:, j] - simulated[:, j],
        }
        plots.append({"name": name, "unit": unit, **arrays.picture(t, curves, span(args), points(args))})
    for j, (name, unit) in enumerate((args.get("inputs") or {}).items()):
        curves = {"recorded": held[f"{k}/u"][:, j]}
        plots.append({"name": name, "unit": unit, **arrays.picture(t, curves, span(args), points(args))})
    return {"plots": plots, "span": [float(t[0]), float(t[-1])]}


def compare_xy(args: Args, say: Say) -> Answer:
    """Return one quantity over another: ``x`` and ``y`` name channels, inputs or ``residual of CHANNEL``; measured and
    simulated at the same samples, at most `MOST_XY` of them.
    """
    held, k = np.load(args["store"]), int(args.get("stretch") or 0)
    how = "free" if args.get("how") == "free" else "windowed"
    sides = {side: held[f"{k}/{name}"] for side, name in (("measured", "measured"), ("simulated", how))}
    t, u = held[f"{k}/t"], held[f"{k}/u"]
    part = arrays.window(t, *span(args))
    every = max(1, (part.stop - part.start) // MOST_XY)
    channels, inputs = list(args["channels"]), list(args.get("inputs") or {})

    def values(name: str, side: str) -> Any:
        if name in inputs:
            return u[:, inputs.index(name)]
        own = name.removeprefix("residual of ")
        if own not in channels:
            raise InputError(f"no such quantity: {name!r}")
        j = channels.index(own)
        return sides["measured"][:, j] - sides["simulated"][:, j] if own != name else sides[side][:, j]

    x, y = str(args.get("x")), str(args.get("y"))
    points_of = {side: [arrays.encoded(values(n, side)[part][::every]) for n in (x, y)] for side in sides}
    return {"x": x, "y": y, "curves": points_of}


# -------------------------------------------------------------------- diagnose, add


def diagnose(args: Args, say: Say) -> Answer:
    """Return the JSON of `signlin diagnose`, and the evidence picture of every named effect."""
    from signlin_ros.workbench import evidence

    if arm := _arm(args):
        from signlin_ros.workbench import arms

        return arms.diagnose(arm, args, say)
    result = _diagnosed("diagnose", args, say)
    content = result.to_json()
    model, (first, second) = _LAST[str(args.get("key"))][1:3]
    limits = planning.asked_limits(model, [*first, *(second or ())])
    errors = _errors(console.ladder_rows(content))
    return {"json": content, "errors": errors, "limits": limits, **evidence.shown(result)}


def experiment(args: Args, say: Say) -> Answer:
    """Plan what to record next, see `planning.planned`."""
    return planning.planned(args, say, _sides)


def rivals(args: Args, say: Say) -> Answer:
    """Look at a file of rivals that came through the browser; return what they are called."""
    found = planning.rivals_of(args["file"], Path(args["file"]).parent, dropped=True)
    return {"rivals": [" with ".join(map(printed_name, one.effects)) or "nothing more" for one in found]}


def add(args: Args, say: Say) -> Answer:
    """Add and fit ``args["effect"]`` and write ``args["output"]``; return what `signlin add --json` prints."""
    from signlin_ros.files import write_text
    from signlin_ros.workbench import evidence

    if args["effect"] == "learned_force":
        return learn(args, say)
    result = _diagnosed("add", args, say)
    write_text(args["output"], result.yaml)
    return {"json": result.to_json(), **evidence.shown(result, args["effect"])}


def _sides(args: Args) -> tuple[Model, list[ModelData], list[ModelData] | None, list[Any]]:
    """Return the model, the records for the fit, those for validation (None: there are none), and what was found."""
    model, records, findings = _loaded(args, [*args["data"], *args["validation"]])
    given, unseen = list(args["data"]), list(args["validation"])
    return model, _of(records, given, unseen), _of(records, unseen, given) or None, findings


def _diagnosed(verb: str, args: Args, say: Say) -> Any:
    """Run a verb as the command line does; its result is kept for the report."""
    from signlin_ros import diagnosis
    from signlin_ros.diagnosis.progress import Progress
    from signlin_ros.diagnosis.proposal import printed

    model, first, second, findings = _sides(args)
    records, effect = [*first, *(second or ())], args.get("effect")
    run, ranking = getattr(diagnosis, verb), Ranking(say)
    watched = Progress(ranking.stage, seen=ranking.seen)
    more = {"rivals": planning.rivals_of(args["rivals"], model.folder)} if args.get("rivals") else {}
    result = run(
        *([effect] if effect else []), model, first, second, jobs=os.cpu_count() or 1, progress=watched, **more
    )
    result = printed(result, opened(args["model"]), args.get("output"), records)
    _LAST[str(args.get("key"))] = (result, model, (first, second), findings)
    return result


_LAST: dict[str, Any] = {}
"""What was found in this process, by key: a report needs more of it than is kept."""


def report(args: Args, say: Say) -> Answer:
    """Write the report on the model as it is to ``args["report"]``: what was added to it, and the last diagnosis, where
    that is of this model; else how it compares.
    """
    from signlin_ros.report import added, compare_report, diagnosis_report

    say({"what": "writing the report (model and script are there already)", "share": 0.2})
    command = str(args.get("command") or "")
    steps = [added.Added(a["effect"], a["json"], _LAST.get(a["key"], (None,))[0]) for a in args.get("added") or ()]
    first = [added.added_section(steps, opened(args["model"]))] if steps else []
    held = _LAST.get(str(args.get("diagnosis")))
    if held is not None:
        result, base, data, findings = held
        diagnosis_report(result, args["report"], command, data, base, record=findings, first=first)
    else:
        from signlin_ros.diagnosis import compare as run

        loaded, records, findings = _loaded(args, args["data"])
        compare_report(run(loaded, records), args["report"], command, findings, first, added.lead_of(steps))
    return {"report": args["report"]}


# -------------------------------------------------------------------- use


def tune(args: Args, say: Say) -> Answer:
    """Return simulation, residual, A_k, B_k and poles of a model with other parameter values."""
    signals = tuple(sorted((args.get("signals") or {}).items()))
    stamps = tuple(Path(p).stat().st_mtime_ns for p in (args["model"], args["file"]) if Path(p).exists())
    bench = _bench(args["model"], args["file"], signals, tuple(args.get("cures") or ()), stamps)
    return bench.answer(args["values"], args.get("at"), span(args), points(args))


@lru_cache(maxsize=2)
def _bench(model: str, file: str, signals: Any, cures: Any, stamps: Any) -> tuning.TuningBench:
    loaded, (record,), _ = _loaded({"model": model, "signals": dict(signals), "cures": cures}, [file])
    return tuning.TuningBench(loaded, record)


def learn(args: Args, say: Say) -> Answer:
    """Learn what is missing as a curve over ``args["over"]`` and write ``args["output"]``; as `add`."""
    from signlin_ros.learning import add_learned

    say({"what": "learning a curve", "share": 0.1})
    model, first, second, _ = _sides(args)
    new, content = add_learned(model, first, second, str(args["over"]))
    original, output = opened(args["model"]), Path(args["output"])
    new = new.with_options(with_position=original.with_position).placed_in(output.parent)
    new.save(output)
    why = "A curve that was learned: see the plots of Compare for what it takes away."
    return {
        "json": {**content, "model": new.to_yaml()},
        "errors": _errors(console.ladder_rows(content)),
        "evidence": {},
        "values": {"learned_force": {"over": str(args["over"])}},
        "unseen": {"learned_force": why},
    }


FREE = 1.0
"""How far, in logarithms, numbers may be off that are to be fitted anew: the records decide."""


def refit(args: Args, say: Say) -> Answer:
    """Write a model with the base parameters that fit the records of ``args["data"]`` best to ``args["output"]``.

    They are freer than those of the refitted rows of `compare` and `diagnose`, which stay within the model's tolerance.
    """
    from signlin_ros.diagnosis.dataset import dataset_of
    from signlin_ros.diagnosis.evidence import refitted_evidence
    from signlin_ros.diagnosis.proposal import rounded

    if _arm(args):
        raise InputError("an arm is refitted in a terminal: signlin refine MODEL DATA -o NEW.yaml")
    say({"what": "refitting", "share": 0.1})
    model, first, second, _ = _sides(args)
    original, output = opened(args["model"]), Path(args["output"])
    found = refitted_evidence(dataset_of(model.with_options(tolerance=FREE), first, second)).base
    kept = {"with_position": original.with_position, "tolerance": original.tolerance}
    new = rounded(found.model, found.parameters).with_options(**kept)
    new.placed_in(output.parent).save(output)
    return {"parameters": {name: one.to_json() for name, one in found.parameters.items()}}


def written(args: Args, say: Say) -> Answer:
    """Write a model of the numbers of a data sheet to ``args["output"]``; a motor's with its angle, if ``columns``
    ([label, unit], ...) show one.
    """
    model = sheet.model_of(str(args["form"]), args["values"])
    turns = any(shows_angle(label, unit) for label, unit in args.get("columns") or ())
    if turns and model.plant.position not in model.states:
        model = model.with_options(with_position=True)
    model.save(args["output"])
    return {"output": args["output"]}


def keep(args: Args, say: Say) -> Answer:
    """Write a model with other parameter values to ``args["output"]``."""
    output = Path(args["output"])
    tuning.changed(opened(args["model"]), args["values"]).placed_in(output.parent).save(output)
    return {"output": str(output)}


def sample(args: Args, say: Say) -> Answer:
    """Write the sample records and their model to a folder; return the files."""
    from signlin_ros.workbench.sample import write_sample

    return {"files": [str(file) for file in write_sample(Path(args["folder"]))]}


WORKER_CALLS: dict[str, Callable[[Args, Say], Answer]] = {
    f.__name__: f
    for f in (
        *(
            use,
            ready,
            reader,
            models,
            describe,
            code,
            columns,
            propose,
            record_curves,
            check,
            compare,
            compare_curves,
            diagnose,
            add,
        ),
        *(compare_xy, report, tune, keep, sample, search, refit, written, experiment, rivals, planning.plan_curves),
    )
}
"""What a worker process can be asked for."""


__all__ = ["WORKER_CALLS", "CodeError", "InputError"]
