"""What is seen of a record before anything is done with it: its columns, their curves, and which signal each may be."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from signlin_ros.errors import InputError, MissingExtraError, one_line
from signlin_ros.model import Model
from signlin_ros.records import Note, Record, Signal, read_record, read_runs
from signlin_ros.workbench import arrays, proposing
from signlin_ros.workbench.clocks import asked_time
from signlin_ros.workbench.uploaded import opened

Args = Mapping[str, Any]
Say = Callable[[dict[str, Any]], None]
Answer = dict[str, Any]
BY_ROW = "1.0"
"""What is said of the time of a record whose time is not known: that its rows are 1 apart."""
PLOTS = 40
"""So many columns are drawn."""
FOUND = 50
"""So many columns are told of those that were looked for."""
ASKED_TIME_UNIT = re.compile(r"say --signal '?t = ([^']+ \[\w+\])'")
"""What the reader would say of a time whose unit it asks for."""


def columns(args: Args, say: Say) -> Answer:
    """Return the content of a record: columns with units and ranges, its length, the reader's notes.

    ``texts``: columns of text, which a formula may use where they hold a direction. ``error``: why it cannot be read as
    is said; ``untimed``: but for its time, so that the columns are shown over their rows. ``time``: from which columns
    the time was read, and what may be said of it (``t [ms]``).
    """
    file = args["file"]
    try:
        return _columns(_record(file, args.get("time")), "")
    except (InputError, MissingExtraError) as error:
        why = one_line(error)
    try:
        return _columns(_record(file, BY_ROW), why)
    except (InputError, MissingExtraError):
        nothing: Answer = {"columns": [], "texts": [], "notes": [], "samples": 0, "start": 0.0, "end": 0.0, "step": 0.0}
        return {**nothing, "time": {"columns": [], "asked": ""}, "error": why, "untimed": False}


def _columns(record: Record, error: str) -> Answer:
    step = float(np.median(np.diff(record.t))) if len(record) > 1 else 0.0
    asked = (ASKED_TIME_UNIT.search(note) for note in map(str, record.notes))
    clock = asked_time(record) if error else next((found[1] for found in asked if found), "")
    said = [note for note in record.notes if not (error and isinstance(note, Note) and note.kind == "clock")]
    return {
        "columns": [_column(name, s) for name, s in record.signals.items()],
        "samples": len(record),
        "start": float(record.t[0]),
        "end": float(record.t[-1]),
        "step": step,
        "notes": said,
        "texts": [name for name, why in _left_out(record).items() if "infinite" not in why],
        "time": {
            "columns": [] if error else [s.label or name for name, s in record.clocks.items()],
            "asked": clock,
        },
        "error": error,
        "untimed": bool(error),
    }


def _column(name: str, signal: Signal) -> Answer:
    return {"name": name, "label": signal.label or name, "unit": signal.unit, **_range(signal.values)}


def search(args: Args, say: Say) -> Answer:
    """Return the columns whose names hold all words of ``args["filter"]``, at most `FOUND`, and how many there are."""
    record = _shown(args)
    words = str(args.get("filter") or "").lower().split()
    named = [(name, s) for name, s in record.signals.items() if all(w in (s.label or name).lower() for w in words)]
    return {"columns": [_column(name, s) for name, s in named[:FOUND]], "count": len(named)}


def propose(args: Args, say: Say) -> Answer:
    """Return which column seems to be which signal of the model, and why; ``error``: why it cannot be read so."""
    model, time = opened(args["model"]), args.get("time")
    records = [_record(file, time) for file in args["files"]]
    rows = proposing.mapping(model, records, args.get("signals") or {})
    said = {r["signal"]: r["column"] for r in rows if r["column"] and (r["set"] or r["proposed"])}
    lacking = any(r["needed"] and not r["column"] for r in rows)
    return {"mapping": rows, "error": None if lacking else _unreadable(model, args["files"], said, time)}


def _unreadable(model: Model, files: Sequence[str], said: Mapping[str, str], time: str | None) -> str | None:
    """Return why records cannot be read as a mapping says; None where they can."""
    signals = {**said, **({"t": time} if time else {})}
    for file in files:
        record = _record(file, time)
        with contextlib.suppress(InputError):  # of text, and of fields of a bag, only the reader knows what is wanted
            if not _left_out(record):
                record.for_model(model, said)
                continue
        try:
            read_runs(file, model, signals)
        except InputError as error:
            return one_line(error)
    return None


def _left_out(record: Record) -> dict[str, str]:
    """Return the columns that were left out, and the notes that say so."""
    notes = (n for n in record.notes if isinstance(n, Note))
    return {n.channel: n for n in notes if n.kind == "left_out" and n.channel}


def record_curves(args: Args, say: Say) -> Answer:
    """Return columns of a record between two times, few enough points to draw: those named by ``args["columns"]``, or
    the first ones. ``rows``: over the rows, as there is no time.
    """
    record = _shown(args)
    wanted = [str(label) for label in args.get("columns") or ()]
    named = [(name, s) for name, s in record.signals.items() if not wanted or (s.label or name) in wanted]
    plots = [
        {"name": name, "unit": s.unit, **arrays.picture(record.t, {"recorded": s.values}, span(args), points(args))}
        for name, s in named[:PLOTS]
    ]
    said = {"rows": args.get("time") != BY_ROW and bool(_fault(args)), "count": len(named)}
    return {"plots": plots, "span": [float(record.t[0]), float(record.t[-1])], **said}


def _shown(args: Args) -> Record:
    """Return a record as it is shown: over its rows where its time is not known."""
    return _record(args["file"], BY_ROW if _fault(args) else args.get("time"))


def _fault(args: Args) -> str:
    try:
        _record(args["file"], args.get("time"))
    except (InputError, MissingExtraError) as error:
        return one_line(error)
    return ""


def _record(file: str, time: str | None = None) -> Record:
    path = Path(file)
    stamp = path.stat().st_mtime_ns if path.exists() else 0
    return _read(file, stamp, time)


@lru_cache(maxsize=6)
def _read(file: str, stamp: int, time: str | None) -> Record:
    return read_record(file, {"t": time} if time else None, wanted=())


def _range(values: Any) -> Answer:
    good = values[np.isfinite(values)]
    if not good.size:
        return {"low": None, "high": None, "missing": int(values.size)}
    return {"low": float(good.min()), "high": float(good.max()), "missing": int(values.size - good.size)}


def span(args: Args) -> Sequence[float | None]:
    """Return from when to when a picture goes (s), None: to its end."""
    return args.get("from"), args.get("to")


def points(args: Args) -> int:
    """Return how many points of a curve are wanted."""
    return int(min(max(args.get("points") or arrays.MAX_CURVE_POINTS, 10), arrays.MAX_CURVE_POINTS))


__all__ = ["BY_ROW", "columns", "points", "propose", "record_curves", "search", "span"]
