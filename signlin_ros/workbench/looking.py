"""What is seen of a record before anything is done with it: its columns, their curves, and which signal each may be."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from signlin_ros.errors import InputError, one_line
from signlin_ros.model import Model
from signlin_ros.records import Note, Record, read_record, read_runs
from signlin_ros.workbench import arrays, proposing
from signlin_ros.workbench.uploaded import opened

Args = Mapping[str, Any]
Say = Callable[[dict[str, Any]], None]
Answer = dict[str, Any]


def columns(args: Args, say: Say) -> Answer:
    """Return what a record holds: its columns with units and ranges, its length, what the reader noted.

    ``texts``: columns of text, which a formula may use where they hold a direction.
    """
    record = _record(args["file"], args.get("time"))
    found = [
        {"name": name, "label": s.label or name, "unit": s.unit, **_range(s.values)}
        for name, s in record.signals.items()
    ]
    step = float(np.median(np.diff(record.t))) if len(record) > 1 else 0.0
    return {
        "columns": found,
        "samples": len(record),
        "start": float(record.t[0]),
        "end": float(record.t[-1]),
        "step": step,
        "notes": list(record.notes),
        "texts": [name for name, why in _left_out(record).items() if "infinite" not in why],
    }


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
    """Return the columns of a record between two times, few enough points to draw."""
    record = _record(args["file"], args.get("time"))
    curves = {name: s.values for name, s in record.signals.items()}
    units = {name: s.unit for name, s in record.signals.items()}
    plots = [
        {"name": name, "unit": units[name], **arrays.picture(record.t, {"recorded": y}, span(args), points(args))}
        for name, y in curves.items()
    ]
    return {"plots": plots, "span": [float(record.t[0]), float(record.t[-1])]}


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
    return int(min(max(args.get("points") or arrays.MOST, 10), arrays.MOST))


__all__ = ["columns", "points", "propose", "record_curves", "span"]
