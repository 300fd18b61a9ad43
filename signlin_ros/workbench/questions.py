"""What the page asks of the worker, by stage; and the same as command lines, a script and a report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from signlin_ros.workbench import columns, commands
from signlin_ros.workbench.project import fresh

if TYPE_CHECKING:
    from signlin_ros.workbench.session import Session

AS_THEY_ARE = "none"
"""The cure that takes records as they are."""


def question(s: Session, verb: str) -> dict[str, Any]:
    """Return the arguments of a verb: model, records, mapping, cures."""
    p, c = s.project, s.project.choices
    data, validation = p.files("estimation"), p.files("validation")
    if verb == "compare" and not _of_arm(s):  # an arm's table is of data that no fit saw
        data, validation = validation or data, []
    base: dict[str, Any] = {"model": p.path(c["model"]), "data": data, "validation": validation}
    base["signals"] = columns.signals(s, [*data, *validation])
    cures = _cures(s, [*data, *validation]) if verb == "compare" else c["cures"]
    if verb == "diagnose" and fresh(c) and c["planned"]["model"] == c["model"]:
        base["rivals"] = p.path(c["planned"]["files"]["rivals"])
    return {**base, "cures": cures} if cures else base


def _of_arm(s: Session) -> bool:
    found = described(s)
    return found is not None and found["plant"] == "arm"


def _cures(s: Session, files: list[str]) -> list[str]:
    """Return the chosen cures that the check offers for some of the records: the others would be refused there."""
    chosen: list[str] = s.project.choices["cures"]
    found = result(s, "check", question(s, "check"))
    findings = found["json"]["findings"] if found else []
    offered = {f["cure"] for f in findings if str(f.get("record", "")).startswith(tuple(files))}
    return [cure for cure in chosen if cure in offered or cure == AS_THEY_ARE]


def step(s: Session, verb: str) -> dict[str, Any] | None:
    """Return the step that a verb is on the command line; None for a check that was not done."""
    asked = question(s, verb)
    if verb == "check":
        found = result(s, "check", asked)
        if found is None:
            return None
        return {"verb": verb, **asked, "data": [*asked["data"], *asked["validation"]], "validation": []}
    return {"verb": verb, **asked}


def result(s: Session, verb: str, asked: dict[str, Any]) -> Any:
    """Return the answer to a question, None before there is one."""
    return s.project.result(s.project.key(verb, asked))


def asked_of(done: dict[str, Any]) -> dict[str, Any]:
    """Return the question of a step."""
    return {k: v for k, v in done.items() if k != "verb"}


def used(s: Session, target: str) -> dict[str, Any]:
    """Return the arguments of an export: those of a comparison, and the target."""
    return {**question(s, "compare"), "target": target}


def described(s: Session) -> Any:
    """Return the arguments that describe the model."""
    model = s.project.choices["model"]
    return None if model is None else result(s, "describe", {"model": s.project.path(model)})


def script(s: Session) -> str:
    """Return the script of what was done."""
    steps = commands.distinct(s.project.choices["path"])
    texts = {step["output"]: step["text"] for step in steps if step["verb"] == "set"}
    return commands.script(Path.cwd(), s.project.place("replay"), steps, texts)


def reported(s: Session) -> dict[str, Any]:
    """Return the arguments of a report: the model as it is, what was added to it, the diagnosis of it if there is
    one, and the comparison.
    """
    asked, path = question(s, "compare"), s.project.choices["path"]
    steps = [(x, result(s, "add", asked_of(x))) for x in path if x["verb"] == "add"]
    added = [
        {"effect": x["effect"], "json": found["json"], "key": s.project.key("add", asked_of(x))}
        for x, found in steps
        if found is not None
    ]
    done = [x for x in path if x["verb"] == "diagnose" and x["model"] == asked["model"]]
    if not done:
        return {**asked, "added": added, "command": commands.command({"verb": "compare", **asked})}
    key = s.project.key("diagnose", asked_of(done[-1]))
    return {**asked, "added": added, "diagnosis": key, "command": commands.command(done[-1])}


__all__ = ["AS_THEY_ARE", "asked_of", "described", "question", "reported", "result", "script", "step", "used"]
