"""What the page knows of a plan of the next record: what was asked for, its files, and which records came after it.

The choice ``planned`` of a project: ``asked``, what the worker was asked (None: the file of rivals was dropped);
``model``: for which; ``records``: files that were there before; ``files``: kind -> name of what it wrote; ``names``:
what the rivals are called.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from signlin_ros.errors import InputError
from signlin_ros.workbench import columns, commands
from signlin_ros.workbench.project import fresh, plan_of
from signlin_ros.workbench.questions import question, result
from signlin_ros.workbench.wording import on_page

if TYPE_CHECKING:
    from signlin_ros.workbench.session import Session

PLAN_FILES = re.compile(r"next_\d+\.(csv|rivals\.json|trajectory\.yaml)")
"""The names of a plan's files in the folder of the project."""
UNDECIDED_STATUSES = ("ambiguous", "not_excited")
"""What a diagnosis says of an effect that another record would decide."""
ALL_OPEN = "all that are open"
MIN_NUMBER = 1e-12
"""What is smaller counts as nothing."""
LIMIT_SPARE = 0.2
"""Part of each limit that is spared where nobody says how much."""


def asked(s: Session, form: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the worker is asked for what somebody wrote; raise `InputError` for what is no number above 0."""
    written = dict(form.get("limits") or {})
    limits = {str(name): value for name, text in written.items() if (value := _number(str(name), text)) is not None}
    between = [str(name) for name in form.get("between") or () if name]
    if len(between) == 1 or len(set(between)) != len(between):
        raise InputError("choose two rivals, or none")
    spare = _number("spared part", form.get("spare"), 0.0, 100.0)
    own = {name: _number(name, form.get(name)) for name in ("duration", "dt")}
    own["spare"] = LIMIT_SPARE if spare is None else spare / 100.0
    return {**question(s, "diagnose"), "limits": limits, "between": between, **own}


def _number(name: str, text: Any, least: float = MIN_NUMBER, most: float = math.inf) -> float | None:
    """Return a number from ``least`` to below ``most``, None where nothing was written."""
    if text is None or not str(text).strip():
        return None
    try:
        value = float(str(text).strip().replace(",", "."))
    except ValueError:
        value = math.nan
    if not least <= value < most:
        allowed = "a number above 0" if most == math.inf else f"{least:g} to below {most:g} %"
        raise InputError(f"{name.replace('_', ' ')}: found {str(text)[:40]!r}; allowed: {allowed}")
    return value


def command(step: Mapping[str, Any], diagnosis: str) -> str:
    """Return the command line that plans the same from the JSON of a diagnosis."""
    return commands.command({**step, "verb": "experiment", "model": diagnosis, "data": [], "validation": []})


# -------------------------------------------------------------------- what the page shows


def shown(s: Session, diagnosis: Any) -> dict[str, Any]:
    """Return the form and the plan below a diagnosis as JSON."""
    content, limits = diagnosis["json"], diagnosis.get("limits") or []
    if not limits or not content.get("rivals"):
        return {"form": None, "plan": None}
    tie = content["verdict"] == "unexplained" or any(e["status"] in UNDECIDED_STATUSES for e in content["ranking"])
    names = ["+".join(r["effects"]) or "nothing" for r in content["rivals"]]
    names += [e["effect"] for e in content["ranking"] if e["status"] != "not_applicable" and e["effect"] not in names]
    form = {"limits": limits, "rivals": list(dict.fromkeys(names)), "tie": tie, "step": _step(s), "every": ALL_OPEN}
    return {"form": form, "plan": _plan(s)}


def _step(s: Session) -> float | None:
    """Return the time between samples of the first record in s."""
    known = (columns.read(s, record) for record in s.project.choices["records"])
    return next((float(f"{found['step']:.3g}") for found in known if found and found.get("step")), None)


def _plan(s: Session) -> dict[str, Any] | None:
    planned = plan_of(s.project.choices)
    if planned is None or not planned["asked"]:
        return None
    key = s.project.key("experiment", planned["asked"])
    found = result(s, "experiment", planned["asked"])
    base = {k: v for k, v in question(s, "diagnose").items() if k != "rivals"}
    if found is None or any(planned["asked"].get(k) != v for k, v in base.items()):
        return None
    told = found["json"]
    told = {**told, "sentence": on_page(told["sentence"]), "notes": [on_page(note) for note in told["notes"]]}
    files = [name for name in planned["files"].values() if (s.project.folder / name).is_file()]
    line = command({**planned["asked"], "output": "next.csv"}, "DIAGNOSIS.json")
    return {"json": told, "previews": found["previews"], "key": key, "files": files, "command": line}


def judges(s: Session) -> dict[str, Any] | None:
    """Return what a diagnosis judges by a plan: its ``rivals``, names of its new ``records``; None: nothing."""
    planned = plan_of(s.project.choices)
    new = fresh(s.project.choices)
    if not planned or not new or planned["model"] != s.project.choices["model"]:
        return None
    names = [Path(r["file"]).name for r in new]
    return {"records": names, "rivals": planned["names"], "twice": len(new) > 1}


def one_to_judge(choices: Mapping[str, Any], records: list[dict[str, Any]]) -> None:
    """Keep the last of the records that came after a plan from the fit, where all of them would be fitted to."""
    new = fresh({**choices, "records": records})
    if new and not any(r["role"] == "validation" for r in new):
        new[-1]["role"] = "validation"


__all__ = ["PLAN_FILES", "asked", "command", "judges", "one_to_judge", "shown"]
