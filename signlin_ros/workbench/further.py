"""What the page shows of Compare, Diagnose, Add and Use, as `stages` does of the first two."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from signlin_ros.errors import joined
from signlin_ros.names import AS_GIVEN, AT_NOISE_RATIO, REFITTED_ROW, printed_name
from signlin_ros.workbench import commands, plans
from signlin_ros.workbench.formats import FILES
from signlin_ros.workbench.questions import asked_of, described, question, result, script, used
from signlin_ros.workbench.stages import EXCHANGED, before, block, check, checked_first
from signlin_ros.workbench.wording import on_page

SAID_IN_SENTENCE = ("no model (less than", "refitted it does:")
"""Parts of notes of a comparison that its sentence says."""
TELLING = 1000.0
"""An error is told in units of the noise up to so many."""

if TYPE_CHECKING:
    from signlin_ros.workbench.session import Session


def compare(s: Session) -> dict[str, Any]:
    """Return the stage Compare as JSON."""
    why = checked_first(s)
    if why:
        return block("compare", why, False, "")
    asked = question(s, "compare")
    found, command = result(s, "compare", asked), commands.command({"verb": "compare", **asked})
    if found is None:
        return block("compare", "", False, "Model and measurement, on top of each other.", command)
    others = _others_compared(s, asked)
    key, lost, mixed = s.project.key("compare", asked), found["lost"], _mixed_up(s)
    text = f"{_lost(lost)}{mixed}" if lost else _compared(found["json"])
    shown = {**found, "json": {**found["json"], "notes": _notes(found["json"]["notes"])}}
    more: dict[str, Any] = {
        "others": others,
        "lost": bool(lost),
        "mixed": bool(mixed),
        "refit": bool(found["json"]["first_rows"]),
    }
    follows = bool(lost) and all(one["follows"] for one in lost)
    return block("compare", "", True, text, command, result=shown, key=key, follows=follows, **more)


def _others_compared(s: Session, asked: dict[str, Any]) -> list[dict[str, str]]:
    """Return the other models that were compared with the same records: the key of their curves, and their names."""
    found: dict[str, str] = {}
    for done in s.project.choices["path"]:
        if done["verb"] == "compare" and done["data"] == asked["data"] and done["model"] != asked["model"]:
            key = s.project.key("compare", asked_of(done))
            if s.project.result(key) is not None:
                found[key] = Path(done["model"]).name
    return [{"key": key, "name": name} for key, name in found.items()]


def _notes(notes: list[str]) -> list[str]:
    """Return the notes of a comparison without those that the sentence replaces."""
    return [on_page(note) for note in notes if not any(text in note for text in SAID_IN_SENTENCE)]


def _lost(channels: list[dict[str, Any]]) -> str:
    """Return the sentence on channels that the model as given does not follow."""
    told = [f"{one['name'].replace('_', ' ')} ({_fits(one)})" for one in channels]
    if all(one["follows"] for one in channels):
        return (
            f"As given, the model does not follow {', '.join(told)}. Refitted it does: its numbers are off, not the"
            " record. Use the refitted values, or write your own."
        )
    nor = "neither as given nor refitted" if any(one["refitted"] is not None for one in channels) else "not"
    return (
        f"The model follows {', '.join(told)} {nor}: an effect is missing, its numbers are far off, or a column is not"
        " what it is taken for. Diagnose tries the effects."
    )


def _fits(one: dict[str, Any]) -> str:
    """Return how a channel is followed, in words."""
    given, refitted = one["given"], one["refitted"]
    after = "" if refitted is None else f", {refitted:.0f} % refitted"
    return ("not at all" if given is None or given < 0 else f"{given:.0f} % of fit") + after


def _mixed_up(s: Session) -> str:
    """Return the check's sentence on exchanged columns; empty where there is none."""
    told = [f["sentence"] for f in check(s).get("findings", ()) if f["check"] == EXCHANGED and not f["applied"]]
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
    ahead = f"over the next {(first or content)['horizon']:.3g} s (the model's update_period)"
    ahead += ", on the last third, held out," if first else ""
    if ratio <= AT_NOISE_RATIO:
        return f"On {names} every prediction {ahead} is no further off than the noise."
    where = f" Most of the error: {content['where'][0]['region']}." if content["where"] else ""
    said = _off(scored[worst], content["channels"].get(worst, {}).get("unit", ""))
    return f"On {names} the {worst} predicted {ahead} is off by {said}.{where}"


def _off(score: dict[str, Any], unit: str) -> str:
    """Return an error in its unit, beside the channel's spread and, where that says something, its noise."""
    ratio, fit = score["rmse_over_noise"], score["fit_percent"]
    text = f"{score['rmse']:.3g} {unit}".rstrip(" -") + " (RMS)"
    text += "" if fit is None else f", {100 - fit:.2g} % of its spread"
    return f"{text}, {ratio:.3g} times the noise" if ratio <= TELLING else text


def diagnose(s: Session) -> dict[str, Any]:
    """Return the stage Diagnose as JSON."""
    why = checked_first(s)
    if why:
        return block("diagnose", why, False, "")
    asked = question(s, "diagnose")
    found, command = result(s, "diagnose", asked), commands.command({"verb": "diagnose", **asked})
    if found is None:
        judge = "the record that no fit sees decides" if asked["validation"] else "the last third, held out, decides"
        text = f"Which effect is missing? All of the catalogue compete; {judge}."
        if _added(s):
            text = "Ask again: does the model lack anything else now?"
        judged = plans.judges(s)
        return block("diagnose", "", False, _judged(judged) or text, command, judged=judged)
    content = _told(found["json"])
    text = f"{content['verdict'].capitalize()}: {_with_waves(content['sentence'], found['values'])}"
    more = {"unseen": _unseen(s), "judged": plans.judges(s), **plans.shown(s, found)}
    return block("diagnose", "", True, text, command, result={**found, "json": content}, **more)


def _judged(judged: dict[str, Any] | None) -> str:
    """Return what a diagnosis does with the records that came after a plan."""
    if judged is None:
        return ""
    rivals, new = joined(judged["rivals"]), joined(judged["records"])
    text = f"Which rival of the plan is it? {rivals} are fitted to {new}, too; what no fit sees decides."
    return text if judged["twice"] else f"{text} Surer with a second run of the same command: drop it, too."


def _with_waves(sentence: str, values: dict[str, dict[str, str]]) -> str:
    """Return a sentence that says of an effect that repeats how often, and how large."""
    for effect, own in values.items():
        words = printed_name(effect)
        if own.get("") and words in sentence:
            sentence = sentence.replace(words, f"{words} ({own['']})", 1)
    return sentence


def _told(content: dict[str, Any]) -> dict[str, Any]:
    """Return a diagnosis in the words of the page."""
    ranking = [{**e, "why": on_page(e["why"] or "")} for e in content["ranking"]]
    lists = {name: [on_page(text) for text in content.get(name) or ()] for name in ("notes", "experiments")}
    return {**content, **lists, "sentence": on_page(content["sentence"]), "ranking": ranking}


def _unseen(s: Session) -> str:
    """Return in words what the validation data are."""
    files = [Path(file).name for file in s.project.files("validation")]
    return ", ".join(files) if files else "the last third of the record, held out"


def add(s: Session) -> dict[str, Any]:
    """Return the stage Add as JSON."""
    why = checked_first(s)
    if why:
        return block("add", why, False, "")
    diagnosis, added = _last(s, "diagnose"), _added(s)
    offers, sure = _offers(s, diagnosis), _sure(diagnosis)
    last = added[-1] if added else None
    text = "Diagnose first: it says what to add. Parameters can be moved by hand already."
    if diagnosis is not None:
        text = "Add the effect that is missing, and watch the error on validation data."
        if not offers:
            text = "Nothing is named that the model does not have. Another effect may be added all the same."
        elif not sure:
            part = ", ".join(printed_name(name) for name in offers)
            text = f"Nothing is named: {part} would explain a part. What is missing can be learned as a curve."
    if last is not None:
        text = _with_waves(on_page(last["json"]["sentence"]), last["found"]["values"])
    command = commands.command(last["step"]) if last else ""
    if not command and offers:
        command = commands.command({"verb": "add", **question(s, "add"), "effect": offers[0], "output": "NEW.yaml"})
    fitted = last["json"]["parameters"] if last else {}
    std = {name: p["std"] for name, p in fitted.items() if p.get("std")}
    more: dict[str, Any] = {"std": std, "offers": offers, "ladder": _ladder(added), "others": _others(s, diagnosis)}
    more |= {"result": last["found"] if last else None, "unseen": _unseen(s), "sure": sure}
    more["learns"] = _nothing_named(diagnosis)
    return block("add", "", bool(added), text, command, **more)


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
    status = {e["effect"]: e["status"] for e in content["ranking"]}
    named = [name for name in content["ladder"][-1]["effects"] if status.get(name) != "rejected"]
    named += [name for name, one in status.items() if one == "confirmed" and name not in named]
    return [name for name in named if name not in there]


def _sure(diagnosis: Any) -> bool:
    """Tell whether a diagnosis says what is missing: then what it names is what comes next."""
    return diagnosis is not None and diagnosis["json"]["verdict"] == "missing"


def _nothing_named(diagnosis: Any) -> bool:
    """Tell whether a diagnosis leaves something that it has no name for."""
    return diagnosis is not None and diagnosis["json"]["verdict"] == "unexplained"


def _others(s: Session, diagnosis: Any) -> list[str]:
    """Return the other effects that may be added, best first."""
    if diagnosis is None:
        return []
    model = described(s)
    there = [*(model["effects"] if model else []), *_offers(s, diagnosis)]
    ranked = [e["effect"] for e in diagnosis["json"]["ranking"] if e["status"] != "not_applicable"]
    return [name for name in ranked if name not in there]


def _ladder(added: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the validation errors before and after every addition: of the motion, and of the force."""
    rungs = []
    for k, one in enumerate(added):
        given, ladder = one["json"]["given"], one["json"]["ladder"]
        if k == 0:
            rungs += [_shown(AS_GIVEN, given)] if given else []
            rungs.append(_shown(REFITTED_ROW if given else AS_GIVEN, ladder[0]))
        rungs.append(_shown(f"+ {printed_name(one['step']['effect'])}", ladder[-1]))
    return rungs


def _shown(label: str, rung: dict[str, Any]) -> dict[str, Any]:
    """Return a rung as the page draws it."""
    left, over = rung["missing_force_percent"], rung.get("missing_force_over_noise")
    force = None if left is None else {"rmse": left, "rmse_over_noise": over}
    return {"label": label, "validation": rung["validation"], "force": force}


def use(s: Session) -> dict[str, Any]:
    """Return the stage Use as JSON."""
    why = before(s)
    if why:
        return block("use", why, False, "")
    folder = s.project.folder / "export"
    there = [n for n in ("model.yaml", "report.html", "replay.sh") if (folder / n).is_file()]
    done = bool(s.project.choices.get("exported")) and bool(there)
    model = s.project.place("export/model.yaml") if done else _launched(s)
    text = "Take the model, the report, and the script of what was done."
    text = f"Written to {s.project.place('export')}." if done else text
    if done and s.busy is not None and s.busy["stage"] == "use":
        text += " The report follows."
    files = there if done else []
    other = _in_another_tool(s, folder)
    return block("use", "", done, text, commands.launch_line(model), files=files, script=script(s), **other)


def _in_another_tool(s: Session, folder: Path) -> dict[str, Any]:
    """Return the targets, the chosen one, and what was found of it: files, what is held and lost, and the loss."""
    target = str(s.project.choices.get("target") or "mjcf")
    found = result(s, "use", used(s, target)) if s.project.choices.get("target") else None
    names = [name for name in FILES[target] if (folder / name).is_file()]
    return {"targets": list(FILES), "target": target, "loss": found["json"] if found and names else None, "made": names}


def _launched(s: Session) -> str:
    """Return the file of the model, also where it was chosen by the name of a shipped one."""
    found = described(s)
    if found and Path(found["file"]).is_absolute():
        return s.project.path(found["file"])
    return str(found["file"] if found else s.project.path(s.project.choices["model"]))


__all__ = ["add", "compare", "diagnose", "use"]
