"""What the page asks of an arm: check, compare and diagnose as the command line prints them; the rest is done there."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from signlin_ros.arms.check import check as look
from signlin_ros.arms.data import read_data, sides
from signlin_ros.arms.told import CANNOT, compared_json, diagnosed_json, sentences
from signlin_ros.arms.verbs import compare as compared
from signlin_ros.arms.verbs import diagnose as diagnosed
from signlin_ros.checks.finding import Finding, to_json
from signlin_ros.checks.run import require_sound
from signlin_ros.model.arm import ArmModel
from signlin_ros.records import ModelData

Args = Mapping[str, Any]
Say = Callable[[dict[str, Any]], None]
Answer = dict[str, Any]


def _records(model: ArmModel, args: Args, files: Sequence[str]) -> list[list[ModelData]]:
    """Return the records of each file, whose mapping may be its own."""
    return [read_data(model, [file], args.get("signals") or {}) for file in files]


def check(model: ArmModel, args: Args) -> Answer:
    """Return the findings in the records of an arm."""
    files = [*args["data"], *args["validation"]]
    records = [record for own in _records(model, args, files) for record in own]
    _, findings = look(model, records, tuple(args.get("cures") or ()))
    return {"json": to_json(findings), "directions": [None] * len(findings)}


def _sides(model: ArmModel, args: Args) -> tuple[Any, Any, list[Finding]]:
    cures = tuple(args.get("cures") or ())
    known = [record for own in _records(model, args, args["data"]) for record in own]
    unseen = [record for own in _records(model, args, args["validation"]) for record in own]
    sound, findings = look(model, [*known, *unseen], cures)
    require_sound(findings, cures)
    return (*sides(model, sound[: len(known)], sound[len(known) :]), findings)


def compare(model: ArmModel, args: Args, say: Say) -> Answer:
    """Return the table of an arm's joints, as `signlin compare --json` prints it."""
    known, unseen, findings = _sides(model, args)
    result = compared(model, known, unseen, progress=_progress(say))
    content = compared_json(result, model.source, list(args["data"]))
    return {"json": {**content, "record": to_json(findings)}, "arm": True, "cannot": list(CANNOT)}


def diagnose(model: ArmModel, args: Args, say: Say) -> Answer:
    """Return the JSON of `signlin diagnose` for an arm."""
    known, unseen, findings = _sides(model, args)
    result = diagnosed(model, known, unseen, progress=_progress(say))
    content = diagnosed_json(result, "", model.source, list(args["data"]))
    content |= {"sentences": sentences(result), "record": to_json(findings)}
    return {"json": content, "arm": True, "cannot": list(CANNOT)}


def _progress(say: Say) -> Callable[[str], None]:
    told: list[str] = []

    def tell(what: str) -> None:
        told.append(what)
        say({"what": what, "share": 1 - 0.8 ** len(told)})

    return tell


__all__ = ["check", "compare", "diagnose"]
