"""What the page shows of every stage: whether it is possible, its sentence, its command, what it found."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from signlin_ros.names import AS_GIVEN, REFITTED
from signlin_ros.workbench import commands

if TYPE_CHECKING:
    from signlin_ros.workbench.session import Session

TITLES = {
    "record": "Record",
    "check": "Check",
    "compare": "Compare",
    "diagnose": "Diagnose",
    "add": "Add",
    "use": "Use",
}
AS_THEY_ARE = "none"
"""The cure that takes records as they are."""
ADVICE = {
    "record": "Drop another file, or correct the mapping below.",
    "check": "Correct the mapping in Record, or drop another record.",
    "compare": "Correct the mapping in Record, or choose another model.",
    "diagnose": "Longer records with more reversals help; a second record helps to be sure.",
    "add": "Choose another effect, or undo.",
    "use": "Correct what is named, then export again.",
}


def advice(stage: str, what: str) -> dict[str, str]:
    """Return what failed, and what to do."""
    return {"what": what, "do": ADVICE[stage]}


# -------------------------------------------------------------------- questions


def mapping_question(s: Session) -> dict[str, Any]:
    """Return what is asked about the mapping."""
    c = s.project.choices
    files = [s.project.path(r["file"]) for r in c["records"]]
    return {"model": s.project.path(c["model"]), "files": files, "signals": c["signals"]}


def question(s: Session, verb: str) -> dict[str, Any]:
    """Return what a verb is asked about: model, records, mapping, cures."""
    p, c = s.project, s.project.choices
    data, validation = p.files("estimation"), p.files("validation")
    if verb == "compare":
        data, validation = validation or data, []
    base = {"model": p.path(c["model"]), "data": data, "validation": validation, "signals": c["signals"]}
    cures = _cures(s, [*data, *validation]) if verb == "compare" else c["cures"]
    return {**base, "cures": cures} if cures else base


def _cures(s: Session, files: list[str]) -> list[str]:
    """Return the chosen cures that the check offers for some of the records: the others would be refused there."""
    chosen: list[str] = s.project.choices["cures"]
    found = _result(s, "check", question(s, "check"))
    findings = found["json"]["findings"] if found else []
    offered = {f["cure"] for f in findings if str(f.get("record", "")).startswith(tuple(files))}
    return [cure for cure in chosen if cure in offered or cure == AS_THEY_ARE]


def step(s: Session, verb: str) -> dict[str, Any] | None:
    """Return the step that a verb is on the command line; None for a check that was not done."""
    asked = question(s, verb)
    if verb == "check":
        found = _result(s, "check", asked)
        if found is None:
            return None
        return {"verb": verb, **asked, "data": [*asked["data"], *asked["validation"]], "validation": []}
    return {"verb": verb, **asked}


def _result(s: Session, verb: str, asked: dict[str, Any]) -> Any:
    return s.project.result(s.project.key(verb, asked))


def _asked(done: dict[str, Any]) -> dict[str, Any]:
    """Return what a step was asked."""
    return {k: v for k, v in done.items() if k != "verb"}


def described(s: Session) -> Any:
    """Return what is known of the model."""
    model = s.project.choices["model"]
    return None if model is None else _result(s, "describe", {"model": s.project.path(model)})


def mapping(s: Session) -> list[dict[str, Any]]:
    """Return the mapping, a row for each signal; empty before it is known."""
    if s.project.choices["model"] is None:
        return []
    found = _result(s, "propose", mapping_question(s))
    return found["mapping"] if found else []


def mapped(s: Session) -> bool:
    """Tell whether there is a record with all that the model needs."""
    rows = mapping(s)
    records = s.project.choices["records"]
    driven = all(r["column"] for r in rows if r["needed"])
    return bool(records and driven and any(r["column"] for r in rows if r["kind"] != "input"))


def script(s: Session) -> str:
    """Return the script of what was done."""
    steps = commands.distinct(s.project.choices["path"])
    texts = {step["output"]: step["text"] for step in steps if step["verb"] == "set"}
    return commands.script(Path.cwd(), s.project.place("replay"), steps, texts)


def reported(s: Session) -> dict[str, Any]:
    """Return what a report is asked about: the last diagnosis or addition by its key, or else the comparison."""
    asked = question(s, "compare")
    done = [x for x in s.project.choices["path"] if x["verb"] in ("diagnose", "add")]
    if not done:
        return {**asked, "command": commands.command({"verb": "compare", **asked})}
    key = s.project.key(done[-1]["verb"], _asked(done[-1]))
    return {**asked, "diagnosis": key, "command": commands.command(done[-1])}


# -------------------------------------------------------------------- what is shown


def shown(s: Session) -> dict[str, Any]:
    """Return the whole state of the page."""
    p, c = s.project, s.project.choices
    past, future = p.state["past"], p.state["future"]
    blocks = [f(s) for f in (_record, _check, _compare, _diagnose, _add, _use)]
    for block in blocks:
        block["title"] = TITLES[block["id"]]
        block["error"] = s.errors.get(block["id"])
    return {
        "id": p.id,
        "serial": s.serial,
        "folder": p.place(),
        "busy": s.busy,
        "undo": past[-1]["label"] if past else None,
        "redo": future[-1]["label"] if future else None,
        "model": described(s),
        "model_name": Path(c["model"]).name if c["model"] else None,
        "shipped": s.shipped,
        "records": [_record_shown(s, r) for r in c["records"]],
        "mapping": mapping(s),
        "stages": blocks,
    }


def _record_shown(s: Session, record: dict[str, str]) -> dict[str, Any]:
    found = _result(s, "columns", {"file": s.project.path(record["file"])})
    return {**record, "name": Path(record["file"]).name, "path": s.project.path(record["file"]), "found": found}


def _block(stage: str, why: str, done: bool, sentence: str, command: str = "", **more: Any) -> dict[str, Any]:
    return {"id": stage, "why": why, "done": done, "sentence": sentence, "command": command, **more}


def _record(s: Session) -> dict[str, Any]:
    records = [_record_shown(s, r) for r in s.project.choices["records"]]
    read = [r["found"] for r in records if r["found"]]
    if not records:
        return _block("record", "", False, "Drop a record: a table of time, what drives the machine, how it moves.")
    samples, seconds = sum(f["samples"] for f in read), sum(f["end"] - f["start"] for f in read)
    count = f"{len(records)} record{'s' if len(records) > 1 else ''}"
    text = f"{count}, {samples:,} samples, {seconds:.4g} s. "
    lacking = [r["signal"] for r in mapping(s) if r["needed"] and not r["column"]]
    if s.project.choices["model"] is None:
        text += "Choose a model for it."
    elif lacking:
        text += f"No column for {', '.join(lacking)}: choose one below."
    elif mapped(s):
        text += "All that the model needs was found."
    elif mapping(s):
        seen = " or ".join(dict.fromkeys(r["signal"].replace("_", " ") for r in mapping(s) if r["kind"] != "input"))
        text += f"No column for what was measured: choose one for {seen} below."
    if s.project.choices.get("guessed") and s.project.choices["model"]:
        text += f" {_example(s)} Drop the model file of your machine, or choose another one."
    return _block("record", "", mapped(s), text)


def _example(s: Session) -> str:
    """Return what it means that the model was not given."""
    name = s.project.choices["model"]
    return f"The model is the shipped example {name}, which has the signals of the record: its numbers are not yours."


def _before(s: Session) -> str:
    """Return why nothing can be done with the record yet."""
    if not s.project.choices["records"]:
        return "Drop a record first."
    if s.project.choices["model"] is None:
        return "Choose a model first."
    if changed(s):
        return "The files have changed: open the page anew to read them again."
    return "" if mapped(s) else "The mapping is not complete: see Record."


def changed(s: Session) -> bool:
    """Tell whether files are not as they were when they were read."""
    files = [s.project.path(r["file"]) for r in s.project.choices["records"]]
    return s.busy is None and any(_result(s, "columns", {"file": file}) is None for file in files)


def _check(s: Session) -> dict[str, Any]:
    why = _before(s)
    if why:
        return _block("check", why, False, "")
    asked = question(s, "check")
    found = _result(s, "check", asked)
    files = {"data": [*asked["data"], *asked["validation"]], "validation": []}
    command = commands.command({"verb": "check", **asked, **files})
    if found is None:
        return _block("check", "", False, "Not checked yet.", command)
    findings = found["json"].get("findings", [])
    cures = s.project.choices["cures"]
    done = AS_THEY_ARE in cures or not any(f["severity"] == "refuse" and not f.get("applied") for f in findings)
    return _block(
        "check",
        "",
        done,
        _checked(findings) + _whose_numbers(s, findings),
        command,
        findings=findings,
        cures=s.project.choices["cures"],
    )


def _whose_numbers(s: Session, findings: list[dict[str, Any]]) -> str:
    """Return what to think of a scale that does not fit where nobody gave the model."""
    scales = any(str(f.get("cure")).startswith("scale") and not f.get("applied") for f in findings)
    if not scales or not s.project.choices.get("guessed"):
        return ""
    return f" {_example(s)} If only those do not fit, take the records as they are."


def _checked(findings: list[dict[str, Any]]) -> str:
    refused = [f for f in findings if f["severity"] == "refuse" and not f.get("applied")]
    offers = [f for f in findings if f["severity"] == "offer" and not f.get("applied")]
    if refused:
        return f"{len(refused)} finding{'s' * (len(refused) > 1)} must be cured before anything is concluded."
    if offers:
        return f"{len(offers)} finding{'s' * (len(offers) > 1)} with a cure on offer; nothing forbids to go on."
    return "Nothing forbids to go on." if findings else "Nothing was found wrong."


def _checked_first(s: Session) -> str:
    """Return why a conclusion cannot be drawn yet."""
    why = _before(s)
    if why:
        return why
    check = _check(s)
    return "" if check["done"] else "Check comes first: see there what is to be cured."


def _compare(s: Session) -> dict[str, Any]:
    why = _checked_first(s)
    if why:
        return _block("compare", why, False, "")
    asked = question(s, "compare")
    found, command = _result(s, "compare", asked), commands.command({"verb": "compare", **asked})
    if found is None:
        return _block("compare", "", False, "Model and measurement, on top of each other.", command)
    key = s.project.key("compare", asked)
    return _block("compare", "", True, _compared(found["json"]), command, result=found, key=key)


def _compared(content: dict[str, Any]) -> str:
    names = ", ".join(dict.fromkeys(Path(d).name for d in content["data"]))
    first = content.get("first_rows")
    scored = {n: c["windowed"] or c["free_run"] for n, c in content["channels"].items()}
    if first:
        scored = {n: s for n, s in first["given"]["validation"].items() if n != "score"}
    scored = {n: x for n, x in scored.items() if x and x["rmse_over_noise"] is not None}
    if not scored:
        return f"On {names} nothing can be scored: see the notes."
    worst = max(scored, key=lambda n: scored[n]["rmse_over_noise"])
    ratio = scored[worst]["rmse_over_noise"]
    ahead = f"over the next {(first or content)['horizon']:g} s" + (", on unseen data," if first else "")
    if ratio < 1.1:
        return f"On {names} every prediction {ahead} is no further off than the noise."
    where = f" Most of the error: {content['where'][0]['region']}." if content["where"] else ""
    return f"On {names} the {worst} predicted {ahead} is off by {ratio:.3g} times the noise.{where}"


def _diagnose(s: Session) -> dict[str, Any]:
    why = _checked_first(s)
    if why:
        return _block("diagnose", why, False, "")
    asked = question(s, "diagnose")
    found, command = _result(s, "diagnose", asked), commands.command({"verb": "diagnose", **asked})
    if found is None:
        judge = "the record that no fit sees decides" if asked["validation"] else "the last third, held out, decides"
        text = f"Which effect is missing? All of the catalogue compete; {judge}."
        if _added(s):
            text = "Ask again: does the model lack anything else now?"
        return _block("diagnose", "", False, text, command)
    content = found["json"]
    text = f"{content['verdict'].capitalize()}: {content['sentence']}"
    return _block("diagnose", "", True, text, command, result=found)


def _add(s: Session) -> dict[str, Any]:
    why = _checked_first(s)
    if why:
        return _block("add", why, False, "")
    diagnosis, added = _last(s, "diagnose"), _added(s)
    offers = _offers(s, diagnosis)
    last = added[-1] if added else None
    text = "Diagnose first: it says what to add. Parameters can be moved by hand already."
    if diagnosis is not None:
        text = "Add the effect that is missing, and watch the error on unseen data."
        if not offers:
            text = "Nothing was named that is not in the model. Another effect may be added all the same."
    if last is not None:
        text = last["json"]["sentence"]
    command = commands.command(last["step"]) if last else ""
    if not command and offers:
        command = commands.command({"verb": "add", **question(s, "add"), "effect": offers[0], "output": "NEW.yaml"})
    fitted = last["json"]["parameters"] if last else {}
    std = {name: p["std"] for name, p in fitted.items() if p.get("std")}
    more = {"std": std, "offers": offers, "ladder": _ladder(added), "others": _others(s, diagnosis)}
    return _block("add", "", bool(added), text, command, **more)


def _last(s: Session, verb: str) -> Any:
    """Return the last result of a verb on the way to this model."""
    for done in reversed(s.project.choices["path"]):
        if done["verb"] == verb:
            return _result(s, verb, _asked(done))
    return None


def _added(s: Session) -> list[dict[str, Any]]:
    found = []
    for done in s.project.choices["path"]:
        result = _result(s, "add", _asked(done)) if done["verb"] == "add" else None
        if result is not None:
            found.append({"json": result["json"], "step": done})
    return found


def _offers(s: Session, diagnosis: Any) -> list[str]:
    """Return the effects that the last diagnosis names and the model does not have yet."""
    if diagnosis is None:
        return []
    model = described(s)
    there = model["effects"] if model else []
    content = diagnosis["json"]
    named = [*content["ladder"][-1]["effects"]]
    named += [e["effect"] for e in content["ranking"] if e["status"] == "confirmed" and e["effect"] not in named]
    return [name for name in named if name not in there]


def _others(s: Session, diagnosis: Any) -> list[str]:
    """Return what else may be added, best first."""
    if diagnosis is None:
        return []
    model = described(s)
    there = [*(model["effects"] if model else []), *_offers(s, diagnosis)]
    ranked = [e["effect"] for e in diagnosis["json"]["ranking"] if e["status"] != "not_applicable"]
    return [name for name in ranked if name not in there]


def _ladder(added: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return what is left on unseen data before and after every addition: of the motion, and of the force."""
    rungs = []
    for k, one in enumerate(added):
        given, ladder = one["json"]["given"], one["json"]["ladder"]
        if k == 0:
            rungs += [_shown(AS_GIVEN, given)] if given else []
            rungs.append(_shown(REFITTED if given else AS_GIVEN, ladder[0]))
        rungs.append(_shown(f"+ {one['step']['effect'].replace('_', ' ')}", ladder[-1]))
    return rungs


def _shown(label: str, rung: dict[str, Any]) -> dict[str, Any]:
    """Return a rung as the page draws it."""
    left, over = rung["missing_force_percent"], rung.get("missing_force_over_noise")
    force = None if left is None else {"rmse": left, "rmse_over_noise": over}
    return {"label": label, "validation": rung["validation"], "force": force}


def _use(s: Session) -> dict[str, Any]:
    why = _before(s)
    if why:
        return _block("use", why, False, "")
    folder = s.project.folder / "export"
    there = [n for n in ("model.yaml", "report.html", "replay.sh") if (folder / n).is_file()]
    done = bool(s.project.choices.get("exported")) and bool(there)
    model = s.project.path(s.project.choices["model"])
    text = "Take the model, the report, and the script of what was done."
    text = f"Written to {s.project.place('export')}." if done else text
    files = there if done else []
    return _block("use", "", done, text, commands.launch_line(model), files=files, script=script(s))


__all__ = ["advice", "described", "mapped", "mapping_question", "question", "reported", "script", "shown", "step"]
