"""The whole state of the page: what is chosen, the records, the mapping, and a block for each stage."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from signlin_ros.names import PROPER_NAMES
from signlin_ros.workbench import columns, further, joints, stages
from signlin_ros.workbench.questions import described
from signlin_ros.workbench.wording import on_page

if TYPE_CHECKING:
    from signlin_ros.workbench.session import Session


def shown(s: Session) -> dict[str, Any]:
    """Return the whole state of the page."""
    p, c = s.project, s.project.choices
    past, future = p.state["past"], p.state["future"]
    with columns.still(s):
        own: Any = joints if joints.is_arm(s) else further
        blocks = [f(s) for f in (stages.record, stages.check, own.compare, own.diagnose, own.add, own.use)]
        mapping = columns.tables(s)
    for block in blocks:
        block["title"] = stages.TITLES[block["id"]]
        block["error"] = s.errors.get(block["id"]) or block.get("error")
    return {
        "id": p.id,
        "serial": s.serial,
        "proper": PROPER_NAMES,
        "folder": p.place(),
        "busy": s.busy,
        "code": s.code,
        "undo": past[-1]["label"] if past else None,
        "redo": future[-1]["label"] if future else None,
        "model": described(s),
        "model_name": Path(c["model"]).name if c["model"] else None,
        "shipped": s.shipped,
        "forms": s.forms,
        "records": [_record_shown(s, r) for r in c["records"]],
        "mapping": mapping,
        "stages": blocks,
    }


def _record_shown(s: Session, record: dict[str, str]) -> dict[str, Any]:
    found = columns.read(s, record)
    known = ("columns", "texts", "samples", "start", "end", "step", "notes", "untimed", "error")
    found = {name: found[name] for name in known} if found else None
    if found:
        found["columns"] = found["columns"][: columns.MAX_LISTED_COLUMNS]
        found["notes"] = [on_page(note) for note in found["notes"]]
    return {**record, "name": Path(record["file"]).name, "path": s.project.path(record["file"]), "found": found}


__all__ = ["shown"]
