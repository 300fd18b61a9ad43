"""What the page shows of every stage: whether it is possible, its sentence, its command, what it found."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from signlin_ros.names import AS_GIVEN, REFITTED
from signlin_ros.workbench import columns, commands
from signlin_ros.workbench.questions import AS_THEY_ARE, asked_of, described, question, result, script

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
EXCHANGED = "exchanged"
"""The check that finds columns mixed up."""
LOOKED_FOR = (
    "Looked for, by what the model would make of the record: other units and signs, columns mixed up, clocks; and in"
    " each column: jumps, zeros, what is clipped, dead or slow."
)
UNKNOWN = "A wrong column that behaves as the right one would cannot be told from it."
ADVICE = {
    "record": "Drop another file, or correct the mapping below.",
    "check": "Correct the mapping in Record, or drop another record.",
    "compare": "Correct the mapping in Record, or choose another model.",
    "diagnose": "Longer records with more reversals help; a second record helps to be sure.",
    "add": "Choose another effect, or undo.",
    "use": "Correct what is named, then export again.",
}


def advice(stage: str, what: str, code: bool = False) -> dict[str, str]:
    """Return what failed, and what to do; ``code``: a model names code that was not agreed to."""
    return {"what": what, "do": "It runs with all your rights." if code else ADVICE[stage]}


def interrupted(running: dict[str, str]) -> dict[str, str]:
    """Return what to say of what ran when the server ended."""
    what = f"The server ended during {running['what']!r}."
    return {"what": what, "do": "Nothing was changed by it, and nothing found; start it again when you like."}


# -------------------------------------------------------------------- what is shown


def shown(s: Session) -> dict[str, Any]:
    """Return the whole state of the page."""
    p, c = s.project, s.project.choices
    past, future = p.state["past"], p.state["future"]
    with columns.still(s):
        blocks = [f(s) for f in (_record, _check, _compare, _diagnose, _add, _use)]
        mapping = columns.tables(s)
    for block in blocks:
        block["title"] = TITLES[block["id"]]
        block["error"] = s.errors.get(block["id"]) or block.get("error")
    return {
        "id": p.id,
        "serial": s.serial,
        "folder": p.place(),
        "busy": s.busy,
        "code": s.code,
        "undo": past[-1]["label"] if past else None,
        "redo": future[-1]["label"] if future else None,
        "model": described(s),
        "model_name": Path(c["model"]).name if c["model"] else None,
        "shipped": s.shipped,
        "records": [_record_shown(s, r) for r in c["records"]],
        "mapping": mapping,
        "stages": blocks,
    }


def _record_shown(s: Session, record: dict[str, str]) -> dict[str, Any]:
    found = columns.read(s, record)
    return {**record, "name": Path(record["file"]).name, "path": s.project.path(record["file"]), "found": found}


def _block(stage: str, why: str, done: bool, sentence: str, command: str = "", **more: Any) -> dict[str, Any]:
    return {"id": stage, "why": why, "done": done, "sentence": sentence, "command": command, **more}


def _record(s: Session) -> dict[str, Any]:
    records = s.project.choices["records"]
    read = [found for r in records if (found := columns.read(s, r))]
    if not records:
        return _block("record", "", False, "Drop a record: a table of time, what drives the machine, how it moves.")
    samples, seconds = sum(f["samples"] for f in read), sum(f["end"] - f["start"] for f in read)
    count = f"{len(records)} record{'s' if len(records) > 1 else ''}"
    text = f"{count}, {samples:,} samples, {seconds:.4g} s. "
    wrong, lacking = _first(s, columns.wrong), _first(s, columns.lacks)
    if s.project.choices["model"] is None:
        text += "Choose a model for it."
    elif wrong:
        text += "The columns cannot be read as they are mapped."
    elif lacking:
        text += lacking
    elif columns.complete(s):
        text += "All that the model needs is there."
    if s.project.choices.get("guessed") and s.project.choices["model"]:
        text += f" {_example(s)} Drop the model file of your machine, or choose another one."
    done, error = columns.complete(s), advice("record", wrong) if wrong else None
    return _block("record", "", done, text, needs=not done, lacking=bool(wrong or lacking), error=error)


def _first(s: Session, what: Callable[[columns.Table], str]) -> str:
    """Return the first thing that mappings lack, or have wrong, and whose it is."""
    tables = columns.tables(s)
    found = [(table, text) for table in tables if (text := what(table))]
    if not found:
        return ""
    whose = f"{', '.join(found[0][0]['names'])}: " if len(tables) > 1 and what is columns.lacks else ""
    return whose + found[0][1].replace(f"{s.project.place()}/", "")


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
    return "" if columns.complete(s) else "The mapping is not complete: see Record."


def changed(s: Session) -> bool:
    """Tell whether files are not as they were when they were read."""
    return s.busy is None and any(columns.read(s, record) is None for record in s.project.choices["records"])


def _check(s: Session) -> dict[str, Any]:
    why = _before(s)
    if why:
        return _block("check", why, False, "")
    asked = question(s, "check")
    found = result(s, "check", asked)
    files = {"data": [*asked["data"], *asked["validation"]], "validation": []}
    command = commands.command({"verb": "check", **asked, **files})
    if found is None:
        return _block("check", "", False, "Not checked yet.", command)
    findings = [{**f, "remap": remap} for f, remap in zip(found["json"]["findings"], _remaps(s, found), strict=True)]
    cures = s.project.choices["cures"]
    done = AS_THEY_ARE in cures or not any(f["severity"] == "refuse" and not f.get("applied") for f in findings)
    text = _checked(findings) + _named(s) + _whose_numbers(s, findings)
    more = {"findings": findings, "cures": cures, "looked": _looked(s), "needs": not done}
    return _block("check", "", done, text, command, **more)


def _named(s: Session) -> str:
    """Return that columns are what somebody said they are, where somebody did."""
    said = any(row["set"] for table in columns.tables(s) for row in table["rows"])
    return " The columns are taken as you named them." if said else ""


def _remaps(s: Session, found: Any) -> list[dict[str, Any] | None]:
    """Return for every finding what would answer it in the mapping: columns exchanged, a sign from another one."""
    return [
        _remap(s, f, direction) for f, direction in zip(found["json"]["findings"], found["directions"], strict=True)
    ]


def _remap(s: Session, finding: dict[str, Any], direction: dict[str, str] | None) -> dict[str, Any] | None:
    table = columns.of(s, finding["record"])
    if table is None or finding["applied"]:
        return None
    mixed = finding["check"] == EXCHANGED
    signals = columns.exchanged(table, finding["channel"].split(", ")) if mixed else direction
    return {"files": table["files"], "signals": signals} if signals else None


def _looked(s: Session) -> list[str]:
    """Return what a check has looked for, and what it cannot know."""
    tables = columns.tables(s)
    said = [(f"{', '.join(t['names'])}: " if len(tables) > 1 else "") + columns.said(t) for t in tables]
    return [LOOKED_FOR, *(f"Columns as mapped. {text}." for text in said), UNKNOWN]


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
    if check["done"]:
        return ""
    return "Check comes first: see there what is to be cured." if "findings" in check else "Check comes first."


def _compare(s: Session) -> dict[str, Any]:
    why = _checked_first(s)
    if why:
        return _block("compare", why, False, "")
    asked = question(s, "compare")
    found, command = result(s, "compare", asked), commands.command({"verb": "compare", **asked})
    if found is None:
        return _block("compare", "", False, "Model and measurement, on top of each other.", command)
    key = s.project.key("compare", asked)
    text = f"{found['lost']}{_mixed_up(s)}" if found["lost"] else _compared(found["json"])
    return _block("compare", "", True, text, command, result=found, key=key, lost=bool(found["lost"]))


def _mixed_up(s: Session) -> str:
    """Return what the check says of columns that are mixed up; empty where it says nothing."""
    told = [f["sentence"] for f in _check(s).get("findings", ()) if f["check"] == EXCHANGED and not f["applied"]]
    return f" The check: {told[0]}" if told else ""


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
    ahead = f"over the next {(first or content)['horizon']:g} s (the model's update_period)"
    ahead += ", on the last third, held out," if first else ""
    if ratio < 1.1:
        return f"On {names} every prediction {ahead} is no further off than the noise."
    where = f" Most of the error: {content['where'][0]['region']}." if content["where"] else ""
    return f"On {names} the {worst} predicted {ahead} is off by {ratio:.3g} times the noise.{where}"


def _diagnose(s: Session) -> dict[str, Any]:
    why = _checked_first(s)
    if why:
        return _block("diagnose", why, False, "")
    asked = question(s, "diagnose")
    found, command = result(s, "diagnose", asked), commands.command({"verb": "diagnose", **asked})
    if found is None:
        judge = "the record that no fit sees decides" if asked["validation"] else "the last third, held out, decides"
        text = f"Which effect is missing? All of the catalogue compete; {judge}."
        if _added(s):
            text = "Ask again: does the model lack anything else now?"
        return _block("diagnose", "", False, text, command)
    content = found["json"]
    text = f"{content['verdict'].capitalize()}: {content['sentence']}"
    return _block("diagnose", "", True, text, command, result=found, unseen=_unseen(s))


def _unseen(s: Session) -> str:
    """Return in words what the unseen data are."""
    files = [Path(file).name for file in s.project.files("validation")]
    return ", ".join(files) if files else "the last third of the record, held out"


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
            text = "Nothing is named that the model does not have. Another effect may be added all the same."
    if last is not None:
        text = last["json"]["sentence"]
    command = commands.command(last["step"]) if last else ""
    if not command and offers:
        command = commands.command({"verb": "add", **question(s, "add"), "effect": offers[0], "output": "NEW.yaml"})
    fitted = last["json"]["parameters"] if last else {}
    std = {name: p["std"] for name, p in fitted.items() if p.get("std")}
    more: dict[str, Any] = {"std": std, "offers": offers, "ladder": _ladder(added), "others": _others(s, diagnosis)}
    more |= {"result": last["found"] if last else None, "unseen": _unseen(s)}
    return _block("add", "", bool(added), text, command, **more)


def _last(s: Session, verb: str) -> Any:
    """Return the last result of a verb on the way to this model."""
    for done in reversed(s.project.choices["path"]):
        if done["verb"] == verb:
            return result(s, verb, asked_of(done))
    return None


def _added(s: Session) -> list[dict[str, Any]]:
    found = []
    for done in s.project.choices["path"]:
        answer = result(s, "add", asked_of(done)) if done["verb"] == "add" else None
        if answer is not None:
            found.append({"json": answer["json"], "step": done, "found": answer})
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
    model = s.project.place("export/model.yaml") if done else _launched(s)
    text = "Take the model, the report, and the script of what was done."
    text = f"Written to {s.project.place('export')}." if done else text
    files = there if done else []
    return _block("use", "", done, text, commands.launch_line(model), files=files, script=script(s))


def _launched(s: Session) -> str:
    """Return the file of the model, also where it was chosen by the name of a shipped one."""
    found = described(s)
    if found and Path(found["file"]).is_absolute():
        return s.project.path(found["file"])
    return str(found["file"] if found else s.project.path(s.project.choices["model"]))


__all__ = ["advice", "changed", "shown"]
