"""What the page shows of Record and Check: whether they are possible, sentence, command, what was found.

A block is one stage: ``why`` it is not possible (empty where it is), whether it is ``done``, its ``sentence``, the
``command`` that does the same, and what its renderer in ``static/stages.js`` needs.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from signlin_ros.workbench import columns, commands
from signlin_ros.workbench.questions import AS_THEY_ARE, question, result
from signlin_ros.workbench.wording import on_page

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
TIMED = "time_unit"
"""The check that asks for the unit of the time."""
EXCHANGED = "exchanged"
"""The check that finds columns mixed up."""
EMPTY = "Drop a record: a table of time, what drives the machine, how it moves."
LOOKED_FOR = (
    "Looked for, by what the model would make of the record: other units and signs, columns mixed up, clocks; and in"
    " each column: jumps, zeros, what is clipped, dead or slow."
)
UNKNOWN_COLUMN = "A wrong column that behaves as the right one would cannot be told from it."
ADVICE = {
    "record": "Drop another file, or correct the mapping below.",
    "check": "Correct the mapping in Record, or drop another record.",
    "compare": "Correct the mapping in Record, or choose another model.",
    "diagnose": "Longer records with more reversals help; a second record helps to be sure.",
    "plan": "Allow more, keep less margin, or choose two rivals.",
    "add": "Choose another effect, or undo.",
    "use": "Correct what is named, then export again.",
}


def advice(stage: str, what: str, code: bool = False) -> dict[str, str]:
    """Return an error and its remedy as texts; ``code``: a model names code that was not agreed to."""
    return {"what": on_page(what), "do": "It runs with all your rights." if code else ADVICE[stage]}


def interrupted(running: dict[str, str]) -> dict[str, str]:
    """Return the message on the job that was running when the server ended."""
    what = f"The server ended during {running['what']!r}."
    return {"what": what, "do": "Nothing was changed by it, and nothing found; start it again when you like."}


def block(stage: str, why: str, done: bool, sentence: str, command: str = "", **more: Any) -> dict[str, Any]:
    """Return a stage of the page as JSON."""
    return {"id": stage, "why": why, "done": done, "sentence": sentence, "command": command, **more}


def record(s: Session) -> dict[str, Any]:
    """Return the stage Record as JSON."""
    records = s.project.choices["records"]
    read = [found for r in records if (found := columns.read(s, r)) and found["columns"]]
    if not records:
        return block("record", "", False, f"{EMPTY}{_beside(s)}")
    samples, seconds = sum(f["samples"] for f in read), sum(f["end"] - f["start"] for f in read)
    count = f"{len(records)} record{'s' if len(records) > 1 else ''}"
    faults = [text for r in records if (text := columns.fault(s, r))]
    timed, asked = not faults, _asked(s)
    text = f"{count}, {samples:,} samples, {seconds:.4g} s. " if timed else f"{count}. "
    wrong, lacking = _unreadable(s, told=False) or ("" if asked else _first(s, columns.wrong)), _first(s, columns.lacks)
    texts = next(
        (f"{Path(r['file']).name} holds no column of numbers" for r in records if columns.numberless(s, r)), ""
    )
    if texts:
        wrong = f"{texts}; correct the file, or take it out"
        text = f"{count}. One holds no numbers."
    elif not timed and asked:
        text += _asks(asked)
    elif not timed:
        text += _none_read(len(records), len(faults))
    elif asked:
        name, _, unit = asked.rpartition(" [")
        text = f"{count}, {samples:,} samples. "
        text += f"Is the time {name} in {unit.rstrip(']')}? In s it would be {seconds:,.0f} s."
    elif s.project.choices["model"] is None:
        text += "Choose a model for it."
    elif wrong:
        text += "The columns cannot be read as they are mapped."
    elif lacking:
        text += lacking
    elif columns.complete(s):
        text += f"All that the model needs is there.{_left_over(s)}"
    if s.project.choices.get("guessed") and s.project.choices["model"]:
        text += f" {_example(s)} Drop the model file of your machine, or choose another one."
    done, error = columns.complete(s), advice("record", wrong) if wrong else None
    more: dict[str, Any] = {
        "needs": not done,
        "lacking": bool(wrong or lacking or asked),
        "error": error,
        "asked": asked,
    }
    return block("record", "", done, text, **more)


def _beside(s: Session) -> str:
    """Return what is to be said of a robot's description that was dropped before the model that names it."""
    found = [] if s.project.choices["model"] else sorted(s.project.folder.glob("*.urdf"))
    return f" {found[0].name} is there; drop the model file that names it, too." if found else ""


def _none_read(records: int, faults: int) -> str:
    """Return how many records cannot be read."""
    if records == 1:
        return "It cannot be read as it is."
    if faults == records:
        return "None can be read as they are."
    return "One cannot be read as it is." if faults == 1 else f"{faults} cannot be read as they are."


def _asks(asked: str) -> str:
    """Return the question after a time that no column is called."""
    name, _, unit = asked.rpartition(" [")
    return f"No column is called like a time. Is it {name}, in {unit.rstrip(']')}?"


def _asked(s: Session) -> str:
    """Return how the time of records would be read whose unit the reader asks for (``t [ms]``); empty where none is."""
    return next((t["clock"]["asked"] for t in columns.tables(s) if t["clock"]["asked"] and not t["time"]), "")


def _unreadable(s: Session, told: bool = True) -> str:
    """Return why the first record that cannot be read cannot; empty where all can. ``told``: also of those after whose
    time is asked.
    """
    records = [r for r in s.project.choices["records"] if told or not columns.asks(s, r)]
    faults = (columns.fault(s, r) for r in records)
    return next((text.replace(f"{s.project.place()}/", "") for text in faults if text), "")


def _left_over(s: Session) -> str:
    """Return which channels of the model have no column though columns are left over, so that a miss is seen."""
    for table in columns.tables(s):
        names = {c["label"] for c in table["columns"]}
        used = " ".join(str(r["column"]) for r in table["rows"] if r["column"])
        free = [name for name in names if name not in used and name.split(" [")[0] not in used]
        lacking = [r["signal"].replace("_", " ") for r in table["rows"] if not r["column"] and not r["set"]]
        if lacking and free and table["count"] <= columns.MAX_LISTED_COLUMNS:
            shown = ", ".join(sorted(free)[:6]) + (" ..." if len(free) > 6 else "")
            return f" Not measured, as it is mapped: {', '.join(lacking)}; columns not used: {shown}."
    return ""


def _first(s: Session, what: Callable[[columns.Table], str]) -> str:
    """Return the first thing that mappings lack, or have wrong, and whose it is."""
    tables = columns.tables(s)
    found = [(table, text) for table in tables if (text := what(table))]
    if not found:
        return ""
    whose = f"{', '.join(found[0][0]['names'])}: " if len(tables) > 1 and what is columns.lacks else ""
    return whose + found[0][1].replace(f"{s.project.place()}/", "")


def _example(s: Session) -> str:
    """Return the warning that a shipped model stands in for the user's."""
    name = s.project.choices["model"]
    return f"The model is the shipped example {name}, which has the signals of the record: its numbers are not yours."


def before(s: Session) -> str:
    """Return why nothing can be done with the record yet."""
    if not s.project.choices["records"]:
        return "Drop a record first."
    if s.project.choices["model"] is None:
        return "Choose a model first."
    if _unreadable(s) or any(columns.numberless(s, r) for r in s.project.choices["records"]):
        return "A record cannot be read: see Record."
    if changed(s):
        return "The files have changed: open the page anew to read them again."
    if _asked(s):
        return "In which unit is the time? See Record."
    return "" if columns.complete(s) else "The mapping is not complete: see Record."


def changed(s: Session) -> bool:
    """Tell whether files are not as they were when they were read."""
    return s.busy is None and any(columns.read(s, record) is None for record in s.project.choices["records"])


def check(s: Session) -> dict[str, Any]:
    """Return the stage Check as JSON."""
    why = before(s)
    if why:
        return block("check", why, False, "")
    asked = question(s, "check")
    found = result(s, "check", asked)
    files = {"data": [*asked["data"], *asked["validation"]], "validation": []}
    command = commands.command({"verb": "check", **asked, **files})
    if found is None:
        return block("check", "", False, "Not checked yet.", command)
    pairs = zip(found["json"]["findings"], _remaps(s, found), strict=True)
    findings = [{**f, "sentence": on_page(f["sentence"]), "remap": remap} for f, remap in pairs]
    if _estimated(s):  # standard errors of what was found tell more of it
        findings = [f for f in findings if f["check"] != "excitation"]
    cures = s.project.choices["cures"]
    done = AS_THEY_ARE in cures or not any(f["severity"] == "refuse" and not f.get("applied") for f in findings)
    text = _checked(findings) + _named(s) + _whose_numbers(s, findings)
    more = {"findings": findings, "cures": cures, "looked": _looked(s), "needs": not done}
    return block("check", "", done, text, command, **more)


def _estimated(s: Session) -> bool:
    """Tell whether a diagnosis of these records has found values with standard errors."""
    found = result(s, "diagnose", question(s, "diagnose"))
    return found is not None and len(found["json"].get("ladder", ())) > 1


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
    if finding["check"] == TIMED and not finding["cure"]:
        asked = table["clock"]["asked"]
        return (
            {"files": table["files"], "signals": {columns.TIME_COLUMN: asked}, "says": _read_as(asked)}
            if asked
            else None
        )
    mixed = finding["check"] == EXCHANGED
    signals = columns.exchanged(table, finding["channel"].split(", ")) if mixed else direction
    return {"files": table["files"], "signals": signals} if signals else None


def _read_as(asked: str) -> str:
    """Return the button that reads ``t [ms]``."""
    name, _, unit = asked.rpartition(" [")
    return f"Read {name} as {unit.rstrip(']')}"


def _looked(s: Session) -> list[str]:
    """Return a summary of the checks made, and of their limits."""
    tables = columns.tables(s)
    said = [(f"{', '.join(t['names'])}: " if len(tables) > 1 else "") + columns.said(t) for t in tables]
    return [LOOKED_FOR, *(f"Columns as mapped. {text}." for text in said), UNKNOWN_COLUMN]


def _whose_numbers(s: Session, findings: list[dict[str, Any]]) -> str:
    """Return the warning that a scale may be the shipped model's and not the record's."""
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


def checked_first(s: Session) -> str:
    """Return why a conclusion cannot be drawn yet."""
    why = before(s)
    if why:
        return why
    first = check(s)
    if first["done"]:
        return ""
    return "Check comes first: see there what is to be cured." if "findings" in first else "Check comes first."


__all__ = ["EXCHANGED", "advice", "before", "block", "changed", "check", "checked_first", "interrupted", "record"]
