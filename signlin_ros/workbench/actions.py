"""What the page can ask for by a click, each by its name; what takes its time is started and goes on by itself."""

from __future__ import annotations

import functools
import shutil
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Any

from signlin_ros.errors import InputError
from signlin_ros.names import printed_name
from signlin_ros.workbench import columns, plans, questions
from signlin_ros.workbench import trust as trusting
from signlin_ros.workbench.formats import FILES
from signlin_ros.workbench.session import Session

Args = dict[str, Any]
CURVE_COORDINATES = ("speed", "position", "load")
"""What a curve can be learned over."""
MAX_FORMULA_CHARACTERS = 10_000
"""Characters of a formula."""


async def take(s: Session, args: Args) -> None:
    """Take files that were just dropped."""
    names = [str(name) for name in args.get("files", ())]
    if not names or any(not (s.project.folder / name).is_file() or "/" in name or "\\" in name for name in names):
        raise InputError("no such file in this project")
    s.start("record", "reading", lambda: s.take(names), waits=True)


async def sample(s: Session, args: Args) -> None:
    """Take the sample."""
    s.start("record", "making the sample", s.take_sample)


async def model(s: Session, args: Args) -> None:
    """Choose a shipped model."""
    name = str(args.get("name"))
    if name not in [m["name"] for m in await s.models()]:
        raise InputError(f"no such model: {name!r}")
    s.change(f"choose {name}", "record", "reading", s.look, model=name, path=[], guessed=False)


async def role(s: Session, args: Args) -> None:
    """Say what a record is for."""
    records = [dict(r) for r in s.project.choices["records"]]
    record = _one(records, args)
    record["role"] = "estimation" if record["role"] == "validation" else "validation"
    if all(r["role"] == "validation" for r in records):
        raise InputError("one record at least is needed for estimation")
    s.change(f"{record['file']}: for {record['role']}", "check", "checking", s.look, records=records)


async def drop(s: Session, args: Args) -> None:
    """Take a record out of the project; its file stays, so that this can be undone."""
    records = [dict(r) for r in s.project.choices["records"]]
    gone = _one(records, args)
    records.remove(gone)
    if records and all(r["role"] == "validation" for r in records):
        records[0]["role"] = "estimation"
    s.change(f"without {gone['file']}", "record", "reading", s.look, records=records)


def _one(records: list[dict[str, Any]], args: Args) -> dict[str, Any]:
    found = [r for r in records if r["file"] == args.get("file")]
    if not found:
        raise InputError("no such record")
    return found[0]


async def map_signal(s: Session, args: Args) -> None:
    """Say which column a signal of a record is, in which unit, times which factor; or give a formula.

    The records that share the mapping are read so too. An empty formula takes back what was said before.
    """
    signal, table = str(args.get("signal")), columns.of(s, str(args.get("file") or ""))
    if table is None:
        raise InputError("no such record")
    if signal not in {columns.TIME_COLUMN, *(row["signal"] for row in table["rows"])}:
        raise InputError(f"no such signal: {signal!r}")
    said: str | None = str(args.get("column") or "")
    if "formula" in args:
        said = str(args["formula"]).strip() or None
    elif said:
        said = _specification(said, str(args.get("unit") or ""), float(args.get("factor") or 1.0))
    if said and len(said) > MAX_FORMULA_CHARACTERS:
        raise InputError(f"a formula of {len(said):,} characters; allowed: {MAX_FORMULA_CHARACTERS:,}")
    if signal == columns.TIME_COLUMN and not table["fault"]:  # what can be read stays readable
        job = functools.partial(s.look_or_back, table["files"][0])
        s.change(f"time = {said or 'as it was read'}", "record", "reading", job, **_said(s, table, {signal: said}))
        return
    _remap(s, table["files"], {signal: said})


async def known(s: Session, args: Args) -> None:
    """Say what is known of a record, as its gain or its load; an empty value takes it back."""
    records: list[dict[str, Any]] = [dict(r) for r in s.project.choices["records"]]
    one, name, said = _one(records, args), str(args.get("name")), str(args.get("value") or "").strip().replace(",", ".")
    allowed = (questions.described(s) or {}).get("conditions", {})
    if name not in allowed:
        raise InputError(f"no condition of a record: {name!r}; there are: {', '.join(allowed) or 'none'}")
    try:
        float(said or 0.0)
    except ValueError:
        raise InputError(f"{name} of {one['file']}: found {said!r}; allowed: a number") from None
    one["known"] = {k: v for k, v in {**one.get("known", {}), name: said}.items() if v}
    told = f"{name} of {one['file']}: {said or 'not said'}"
    s.change(told, "record", "reading", s.look, records=records, path=[])


async def remap(s: Session, args: Args) -> None:
    """Map columns anew as a finding of the check proposes."""
    findings = next(b for b in s.shown()["stages"] if b["id"] == "check").get("findings", ())
    k = int(args.get("finding", -1))
    offered = findings[k]["remap"] if 0 <= k < len(findings) else None
    if not offered:
        raise InputError("no such proposal")
    _remap(s, offered["files"], offered["signals"])


def _said(s: Session, table: columns.Table, said: Mapping[str, str | None]) -> dict[str, Any]:
    """Return the choices with something said of the records of a table."""
    return {"records": columns.with_signals(s, table["files"], said), "path": []}


def _remap(s: Session, files: Sequence[str], said: Mapping[str, str | None]) -> None:
    told = ", ".join(f"{signal} = {spec or 'by its name'}" for signal, spec in said.items())
    s.change(told, "record", "reading", s.look, records=columns.with_signals(s, files, said), path=[])


async def apart(s: Session, args: Args) -> None:
    """Map records with the same columns one by one, or all alike again."""
    table = columns.of(s, str(args.get("file") or ""))
    if table is None or table["alike"] < 2:
        raise InputError("no such record with others of the same columns")
    turned = columns.turned(s, table["files"][0])
    s.change("map records apart", "record", "reading", s.look, records=turned, path=[])


def _specification(column: str, unit: str, factor: float) -> str:
    """Return a column as ``--signal`` takes it."""
    bare = f"{column.split(' [', maxsplit=1)[0]} [{unit}]" if unit else column
    return bare if factor == 1.0 else f"{factor:.10g} * {bare}"


async def cure(s: Session, args: Args) -> None:
    """Apply a cure that the check has offered, or take it back."""
    name, cures = str(args.get("name")), list(s.project.choices["cures"])
    offered = {f["cure"] for b in s.shown()["stages"] for f in b.get("findings", ()) if f.get("cure")}
    if name not in {*offered, *cures, questions.AS_THEY_ARE}:
        raise InputError(f"no such cure: {name!r}")
    changed = [c for c in cures if c != name] if name in cures else [*cures, name]
    s.change(f"{'without ' * (name in cures)}cure {name}", "check", "checking", s.look, cures=changed)


async def undo(s: Session, args: Args) -> None:
    """Take the last step back."""
    _turned(s, s.project.undo)


async def redo(s: Session, args: Args) -> None:
    """Take again what was taken back."""
    _turned(s, s.project.redo)


def _turned(s: Session, turn: Callable[[], None]) -> None:
    """Go a step back or on, and read what is not known of the choices that hold then."""
    s.idle()
    turn()
    s.errors = {}
    s.wake()


async def trust(s: Session, args: Args) -> None:
    """Run the code that a model names, which was shown; ``digests``: of the files that were looked at."""
    shown = {one["digest"] for one in s.code}
    digests = [str(one) for one in args.get("digests", ())]
    if not digests or not shown.issuperset(digests):
        raise InputError("no such code was shown")
    s.idle()
    trusting.agree(digests)
    s.start("record", "reading", s.look)


async def check(s: Session, args: Args) -> None:
    """Check the records."""
    s.start("check", "checking", s.look)


async def compare(s: Session, args: Args) -> None:
    """Compare model and measurement."""
    _possible(s, "compare")
    s.start("compare", "comparing", s.compare)


async def diagnose(s: Session, args: Args) -> None:
    """Ask which effect is missing."""
    _possible(s, "diagnose")
    s.start("diagnose", "diagnosing", s.diagnose)


async def plan(s: Session, args: Args) -> None:
    """Plan what to record next, within the limits that were written."""
    _possible(s, "diagnose")
    block = next(b for b in s.shown()["stages"] if b["id"] == "diagnose")
    if not (block["done"] and block.get("form")):
        raise InputError("Diagnose first: a plan is made for what a diagnosis leaves open.")
    form = plans.asked(s, args)
    s.start("diagnose", "planning what to record next", lambda: s.plan(form))


async def unplan(s: Session, args: Args) -> None:
    """Leave a plan out: records are diagnosed as if there were none."""
    s.idle()
    s.project.change("without the plan", planned=None)


async def add(s: Session, args: Args) -> None:
    """Add an effect and fit it."""
    _possible(s, "add")
    effect = str(args.get("effect"))
    block = next(b for b in s.shown()["stages"] if b["id"] == "add")
    if effect not in (*block["offers"], *block["others"]):
        raise InputError(f"no such effect to add: {effect!r}")
    s.start("add", f"adding {printed_name(effect)}", lambda: s.add(effect))


async def learn(s: Session, args: Args) -> None:
    """Learn what is missing as a curve over the speed, the position or the load."""
    _possible(s, "add")
    over = str(args.get("over"))
    if over not in CURVE_COORDINATES:
        raise InputError(f"no such coordinate: {over!r}; there are: {', '.join(CURVE_COORDINATES)}")
    s.start("add", f"learning a curve over the {over}", lambda: s.learn(over))


async def refit(s: Session, args: Args) -> None:
    """Take the numbers that fit the records best."""
    _possible(s, "compare")
    s.start("compare", "refitting", s.refit)


async def write(s: Session, args: Args) -> None:
    """Make a model file of the numbers of a data sheet."""
    form = {"form": str(args.get("form")), "values": dict(args.get("values") or {})}
    s.start("record", "writing the model file", lambda: s.write(form))


async def keep(s: Session, args: Args) -> None:
    """Keep the values of the sliders as a model version."""
    _possible(s, "add")
    values = {str(k): float(v) for k, v in dict(args.get("values") or {}).items()}
    s.start("add", "comparing", lambda: s.keep(values))


async def export(s: Session, args: Args) -> None:
    """Write what is to be taken away."""
    _possible(s, "use")
    s.start("use", "writing", s.export)


async def use(s: Session, args: Args) -> None:
    """Write the model for another tool, and run it there."""
    _possible(s, "use")
    target = str(args.get("target"))
    if target not in FILES:
        raise InputError(f"no such target: {target!r}")
    s.start("use", f"writing for {target}", lambda: s.use(target))


async def cancel(s: Session, args: Args) -> None:
    """Stop what runs."""
    await s.cancel()


async def clear(s: Session, args: Args) -> None:
    """Begin anew in this project; nothing is deleted but what was exported, and it can be undone."""
    s.idle()
    shutil.rmtree(s.project.folder / "export", ignore_errors=True)
    s.project.change("clear", model=None, records=[], cures=[], path=[], planned=None)
    s.errors = {}


def _possible(s: Session, stage: str) -> None:
    block = next(b for b in s.shown()["stages"] if b["id"] == stage)
    if block["why"]:
        raise InputError(block["why"])


ACTIONS: dict[str, Callable[[Session, Args], Awaitable[None]]] = {
    f.__name__: f
    for f in (
        *(take, sample, model, role, drop, map_signal, known, remap, apart, cure, undo, redo, check, compare, diagnose),
        *(add, learn, refit, write, keep, export, use, cancel, clear, trust, plan, unplan),
    )
}

__all__ = ["ACTIONS"]
