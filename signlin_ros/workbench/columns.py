"""Which column of which record is which signal: records with the same columns share a mapping. No numerics.

A record of the project holds under ``signals`` what was said of it by hand: signal -> column or formula, "" for what
was not measured, ``t`` for the time; under ``known`` conditions, as its gain: parameter -> value. What the reader finds
by itself and what is proposed comes from the worker (`proposing`).
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from signlin_ros.apart import together

if TYPE_CHECKING:
    from signlin_ros.workbench.session import Session

TIME_COLUMN = "t"
ROW_TIME = "1.0"
"""As `looking.BY_ROW`."""
MAX_LISTED_COLUMNS = 100
"""Columns that lists offer."""
Entry = dict[str, Any]
Table = dict[str, Any]


def asked_of(s: Session, record: Entry) -> dict[str, Any]:
    """Return the question to a worker about the columns of a record."""
    time = record.get("signals", {}).get(TIME_COLUMN)
    return {"file": s.project.path(record["file"]), **({"time": time} if time else {})}


def read(s: Session, record: Entry) -> Any:
    """Return the columns of a record; None before they are known."""
    return s.project.result(s.project.key("columns", asked_of(s, record)))


def layout(s: Session, record: Entry) -> tuple[str, ...]:
    """Return the key of a record's columns; of one that is not read yet, its own name."""
    found = read(s, record)
    return tuple(c["label"] for c in found["columns"]) if found and found["columns"] else (record["file"],)


def readable(s: Session, group: Sequence[Entry]) -> bool:
    """Tell whether the columns of records are known, if perhaps not their time."""
    return all((found := read(s, record)) is None or bool(found["columns"]) for record in group)


def fault(s: Session, record: Entry) -> str:
    """Return why a record cannot be read; empty where it can, or is not read yet."""
    found = read(s, record)
    return str(found["error"]) if found else ""


def numberless(s: Session, record: Entry) -> bool:
    """Tell whether a record was read, and none of its columns holds numbers."""
    found = read(s, record)
    return bool(found) and not found["columns"] and not found["error"]


def asks(s: Session, record: Entry) -> bool:
    """Tell whether it is asked which column of a record is its time, in which unit, and nobody has said it."""
    found = read(s, record)
    return bool(found and found["time"]["asked"]) and TIME_COLUMN not in record.get("signals", {})


def groups(s: Session) -> list[list[Entry]]:
    """Return the records, those together that have the same columns and of which the same was said."""
    found: dict[Any, list[Entry]] = {}
    for record in s.project.choices["records"]:
        said = json.dumps(record.get("signals", {}), sort_keys=True)
        own = record["file"] if record.get("apart") else ""
        found.setdefault((layout(s, record), said, own), []).append(record)
    return list(found.values())


def question(s: Session, group: Sequence[Entry], model: str | None = None) -> dict[str, Any]:
    """Return the question to a worker about the mapping of records, for the chosen model or another one."""
    said = group[0].get("signals", {})
    files = [s.project.path(record["file"]) for record in group]
    asked = {"model": model or s.project.path(s.project.choices["model"]), "files": files}
    time = ROW_TIME if any(fault(s, record) for record in group) else said.get(TIME_COLUMN) or ""
    return {**asked, "signals": {k: v for k, v in said.items() if k != TIME_COLUMN}, "time": time}


def tables(s: Session) -> list[Table]:
    """Return the mappings as the page shows them, one for each group of records that are known; see `_table`."""
    if s.tables is not None:
        return s.tables
    known = [group for group in groups(s) if readable(s, group)]
    if s.project.choices["model"] is None:
        nothing: Table = {"mapping": [], "error": None}
        return [_table(s, group, nothing) for group in known if read(s, group[0])]
    found = [(group, s.project.result(s.project.key("propose", question(s, group)))) for group in known]
    return [_table(s, group, answer) for group, answer in found if answer is not None]


def _table(s: Session, group: Sequence[Entry], answer: Any) -> Table:
    columns = read(s, group[0]) or {"columns": [], "texts": [], "time": {"columns": [], "asked": ""}}
    same = [r for r in s.project.choices["records"] if layout(s, r) == layout(s, group[0])]
    return {
        "files": [r["file"] for r in group],
        "names": [Path(r["file"]).name for r in group],
        "rows": answer["mapping"],
        "error": answer["error"],
        "columns": _few(columns["columns"], answer["mapping"]),
        "count": len(columns["columns"]),
        "clock": columns["time"],
        "fault": next((text for r in group if (text := fault(s, r))), ""),
        "texts": columns["texts"],
        "time": group[0].get("signals", {}).get(TIME_COLUMN, ""),
        "alike": len(same),
        "apart": bool(group[0].get("apart")),
    }


def _few(columns: list[Any], rows: Sequence[Any]) -> list[Any]:
    """Return the columns to choose from: the first ones, and those that are mapped; others are searched for."""
    if len(columns) <= MAX_LISTED_COLUMNS:
        return columns
    mapped = {row["column"] for row in rows}
    return [c for k, c in enumerate(columns) if k < MAX_LISTED_COLUMNS or c["label"] in mapped]


@contextlib.contextmanager
def still(s: Session) -> Iterator[None]:
    """While this lasts nothing changes, and the mappings are put together once."""
    s.tables = tables(s)
    try:
        yield
    finally:
        s.tables = None


def unread(s: Session) -> bool:
    """Tell whether there is a model, and records of which it is not known how it is read from them."""
    known = [group for group in groups(s) if readable(s, group)]
    return s.busy is None and s.project.choices["model"] is not None and len(tables(s)) < len(known)


def complete(s: Session) -> bool:
    """Tell whether every record has all that the model needs, and can be read so."""
    found = tables(s)
    there = sum(len(t["files"]) for t in found) == len(s.project.choices["records"]) > 0
    if any(t["clock"]["asked"] and not t["time"] for t in found):
        return False
    return there and s.project.choices["model"] is not None and not any(lacks(t) or wrong(t) for t in found)


def wrong(table: Table) -> str:
    """Return in words what is wrong with a mapping; empty where nothing is."""
    return str(table["fault"] or table["error"] or "")


def lacks(table: Table) -> str:
    """Return in words what a mapping lacks; empty where it is complete."""
    lacking = [r["signal"] for r in table["rows"] if r["needed"] and not r["column"]]
    if lacking:
        return f"No column for {', '.join(lacking)}: choose one below."
    measured = [r for r in table["rows"] if r["kind"] != "input"]
    if any(r["column"] for r in measured):
        return ""
    seen = " or ".join(dict.fromkeys(r["signal"].replace("_", " ") for r in measured))
    return f"No column for what was measured: choose one for {seen} below."


def signals(s: Session, files: Sequence[str]) -> dict[str, str]:
    """Return the ``--signal`` options of records, by their paths: set by hand, or proposed."""
    found: dict[str, dict[str, str]] = {}
    known = {record["file"]: record.get("known", {}) for record in s.project.choices["records"]}
    for table in tables(s):
        said = {r["signal"]: r["column"] for r in table["rows"] if r["column"] and (r["set"] or r["proposed"])}
        said |= {TIME_COLUMN: table["time"]} if table["time"] else {}
        found |= {s.project.path(file): said | known[file] for file in table["files"]}
    return together({file: found.get(file, {}) for file in files})


def of(s: Session, file: str) -> Table | None:
    """Return the mapping of a record; by its name in the project, or what a finding calls it."""
    for table in tables(s):
        if any(file in (f, s.project.path(f)) or file.startswith(s.project.path(f)) for f in table["files"]):
            return table
    return None


def said(table: Table) -> str:
    """Return in words what is read from where, and who says so."""
    by: dict[str, list[str]] = {"as you set it": [], "guessed": [], "by name": []}
    for r in table["rows"]:
        who = "as you set it" if r["set"] else "guessed" if r["proposed"] else "by name"
        by[who] += [f"{r['signal']} = {r['column']}"] if r["column"] else []
    return "; ".join(f"{who}: {', '.join(pairs)}" for who, pairs in by.items() if pairs)


def exchanged(table: Table, order: Sequence[str]) -> dict[str, str]:
    """Return the mapping in which each of some signals has the column of the next one."""
    columns = {r["signal"]: r["column"] for r in table["rows"]}
    pairs = zip(order, (*order[1:], *order[:1]), strict=True)
    return {name: columns[other] for name, other in pairs if columns.get(other)}


def with_signals(s: Session, files: Sequence[str], said: Mapping[str, str | None]) -> list[Entry]:
    """Return the records of the project, with something said of some of them; None takes back what was."""

    def changed(record: Entry) -> Entry:
        if record["file"] not in files:
            return record
        merged = {**record.get("signals", {}), **said}
        return {**record, "signals": {k: v for k, v in merged.items() if v is not None}}

    return [changed(record) for record in s.project.choices["records"]]


def turned(s: Session, file: str) -> list[Entry]:
    """Return the records with those of the same columns as one mapped one by one, or all as that one again."""
    one = next(r for r in s.project.choices["records"] if r["file"] == file)
    more = {"apart": False, "signals": one.get("signals", {})} if one.get("apart") else {"apart": True}
    same = layout(s, one)
    return [{**r, **more} if layout(s, r) == same else r for r in s.project.choices["records"]]


def inherited(s: Session) -> list[Entry]:
    """Return the records of the project; those of which nothing was said yet are read as others with their columns."""
    records: list[Entry] = []
    for record in s.project.choices["records"]:
        if "signals" not in record:
            alike = [r for r in records if layout(s, r) == layout(s, record) and not r.get("apart")]
            record = {**record, "signals": alike[0]["signals"] if alike else {}}  # noqa: PLW2901
        records.append(record)
    return records


__all__ = [
    "asked_of",
    "complete",
    "exchanged",
    "fault",
    "groups",
    "inherited",
    "lacks",
    "of",
    "question",
    "read",
    "readable",
    "said",
    "signals",
    "still",
    "tables",
    "turned",
    "unread",
    "with_signals",
    "wrong",
]
