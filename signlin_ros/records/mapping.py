"""From a record's columns to a model's inputs and measurements: names, order and units of the model."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from signlin_ros import units
from signlin_ros.errors import ModelError, RecordError
from signlin_ros.records.align import align, named
from signlin_ros.records.conditions import apart, conditions_of, parameters_of
from signlin_ros.records.converted import converted
from signlin_ros.records.formulas import by_number, constant, made, sole
from signlin_ros.records.header import TIME_KEYS, heading
from signlin_ros.records.inputs import check_inputs, with_inputs
from signlin_ros.records.notes import Note, as_notes
from signlin_ros.records.slope import rate_of
from signlin_ros.records.table import Record, Signal, frozen

if TYPE_CHECKING:
    from signlin_ros.model import Model

Array = npt.NDArray[np.float64]

ALIASES = ("position", "velocity", "effort")
_JOINT_WORDS = {
    "position": ("position", "pos", "angle", "q"),
    "velocity": ("velocity", "vel", "speed", "qd", "dq"),
    "effort": ("effort", "torque", "tau", "force"),
}
"""What is behind the name of a joint in a table of several."""
_NAME_OF = re.compile(r"(?P<stem>.*?)name(?P<number>_?\d+|\[\d+\])\Z")
"""The label of a column that names the joint of those with the same number."""
_DEFAULT_TOPIC = re.compile(r"(?P<topic>(?:/\w+)*/(?P<role>state|input))\.data\[(?P<index>\d+)\]\Z")


@dataclass(frozen=True, eq=False)
class ModelData:
    """A record in a model's terms: what a simulation needs and what it is compared with. All arrays are
    read-only.

    Attributes
    ----------
    t : (T,) s
    u : (T, m), inputs in the model's order and units, no NaN; held between samples.
    measured : name of a state or output -> (T,), in the model's units; NaN is a missing sample.
    x0 : (n,), the state at t[0] where the first row holds all of it, else None.
    inputs, states : the model's names.
    units : name -> unit of the inputs and measurements; rotary (rad, N·m) where a rotary record drives a
        translational model. unused : heads of the columns that the model has no use for. notes : what was
        done to the data, one sentence each. acts : (T,) s, from when each row of u acts, where the inputs have a
        clock of their own; None: from its own sample on. labels : name -> the column's head or the path in a bag that
        it was read from; records with the same are one log's, however many files that is.
        conditions : values of the model's parameters that are known of this record (`signlin_ros.records.conditions`).
        beside : name -> (T,) as recorded, what the plant asks for to check a record by, and for nothing else.
    """

    t: Array
    u: Array
    measured: dict[str, Array]
    x0: Array | None
    inputs: tuple[str, ...]
    states: tuple[str, ...]
    units: dict[str, str]
    source: str = "record"
    unused: tuple[str, ...] = ()
    notes: tuple[Note | str, ...] = ()
    acts: Array | None = None
    labels: dict[str, str] = field(default_factory=dict)
    conditions: Mapping[str, float] = field(default_factory=dict)
    beside: Mapping[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "notes", as_notes(self.notes))

    def __len__(self) -> int:
        return int(self.t.size)

    @property
    def x(self) -> Array:
        """The measured states, (T, n); NaN where a state is not measured."""
        empty = np.full(self.t.shape, np.nan)
        columns = [self.measured.get(name, empty) for name in self.states]
        return np.stack(columns, axis=1) if columns else np.empty((self.t.size, 0))

    def part(self, start: int | None, stop: int | None = None) -> ModelData:
        """The samples from `start` to before `stop`, with the state at the new start."""
        cut = slice(start, stop)
        measured = {name: frozen(values[cut]) for name, values in self.measured.items()}
        t, u = frozen(self.t[cut]), frozen(self.u[cut])
        acts = None if self.acts is None else frozen(self.acts[cut])
        beside = {name: frozen(values[cut]) for name, values in self.beside.items()}
        x0 = _first_state(measured, self.states)
        return replace(self, t=t, u=u, measured=measured, x0=x0, acts=acts, beside=beside)


def for_model(
    record: Record,
    model: Model,
    signals: Mapping[str, str] | None = None,
    *,
    require: str = "inputs",
    base: str | None = None,
) -> ModelData:
    """Find the model's inputs, states and outputs in a record.

    A name is looked for in this order: `signals` (which must then be there), the model's own ``signals``, a
    column of that name, the topics ``/state`` and ``/input`` of the nodes, the aliases ``position``,
    ``velocity``, ``effort``. An input may be mapped to a number, ``0.0``, that it is throughout, in its unit.

    Parameters
    ----------
    require : ``"inputs"`` refuses a record without the inputs, ``"none"`` takes missing ones as 0, with a
        note. base : for a bag, the signal whose stamps are used; None: the fastest measured one.

    Raises
    ------
    RecordError
        An input is missing, or has gaps too long to hold; a unit does not fit; a mapped column is not there, or mapped
        twice; more than single values are beyond `MAX_SI_VALUE`; what is measured is mapped to a number.
    """
    if require not in ("inputs", "none"):
        raise RecordError(f"require must be 'inputs' or 'none', not {require!r}")
    _check_clock(record)
    signals, told = apart(model, {**apart(model, model.signals)[1], **(signals or {})})
    conditions_notes: list[Note] = []
    conditions = conditions_of(record, model, told, conditions_notes)
    model = model.under(conditions)
    numbers = _numbers(record, model, signals)
    record, chosen, notes, why_not = _chosen(record, model, signals, numbers)
    notes += conditions_notes
    derived = _velocity_of(model, {*chosen, *numbers})
    check_inputs(record, model, {*chosen, *numbers, *derived}, require, notes, why_not)
    record = _aligned(record, model, chosen, base)
    record, chosen = _throughout(record, chosen, numbers)
    values, unit_of = converted(record, model, chosen, notes, numbers)
    notes += [Note(f"{n} is {values[n][0]:g} {unit_of[n]} throughout, as said", "mapped", n) for n in numbers]
    for name, position in derived.items():
        efforts = [values[n] for n in model.outputs if n in values and n not in model.states]
        values[name], noise, held = rate_of(record.t, values[position], next(iter(efforts), None))
        unit_of[name] = {"rad": "rad/s"}.get(unit_of[position], model.units[name])
        smoothed = f", smoothed by as much as its noise, {noise:.2g} {unit_of[position]}" if noise else ""
        if held:
            said = f"{name} is the difference of {position} from sample to sample: it was held in between"
            notes.append(Note(said, "derived", name))
            continue
        notes.append(Note(f"{name} is the derivative of a spline through {position}{smoothed}", "derived", name))
    names = _unique(model.states, model.outputs)
    measured = {name: frozen(values[name]) for name in names if name in chosen}
    measured = {name: values for name, values in measured.items() if not np.isnan(values).all()}
    notes += [
        Note(f"{name} holds no sample", "missing", name) for name in names if name in chosen and name not in measured
    ]
    record, u, measured = with_inputs(record, model, values, measured, notes)
    labels = record.labels
    return ModelData(
        t=record.t,
        u=u,
        measured=measured,
        x0=_first_state(measured, model.states),
        inputs=tuple(model.inputs),
        states=tuple(model.states),
        units=unit_of,
        source=record.source,
        unused=tuple(labels.get(name, name) for name in record.signals if name not in chosen.values()),
        notes=(*record.notes, *notes),
        acts=None if record.acts is None else frozen(record.acts),
        labels={name: labels.get(key, key) for name, key in chosen.items()},
        conditions=conditions,
        beside=_beside(record, model),
    )


def _beside(record: Record, model: Model) -> dict[str, Array]:
    """The columns by which a record of the plant is checked."""
    found = dict[str, Array]()
    for name in model.plant.beside:
        with suppress(RecordError):  # two columns answer to the name
            key = record.find(name, further=False)
            found |= {} if key is None else {name: frozen(record.signals[key].values)}
    return found


def _check_clock(record: Record) -> None:
    """Refuse a time of which nobody knows the unit."""
    for note in record.notes:
        if isinstance(note, Note) and note.kind == "unit_of_time":
            raise RecordError(f"{record.source}: {note}")


def _unique(*groups: tuple[str, ...]) -> list[str]:
    return list(dict.fromkeys(name for group in groups for name in group))


def _numbers(record: Record, model: Model, signals: Mapping[str, str]) -> dict[str, tuple[float, str]]:
    """The inputs that are said to be a number throughout: name -> number, its unit or ""."""
    specs = _canonical(model, model.signals, strict=False) | _canonical(model, signals, strict=True)
    found = {}
    for name in _unique(model.inputs, model.states, model.outputs):
        number = constant(record, specs[name]) if name in specs else None
        if number is None:
            continue
        said = f"{record.source}: {name} = {specs[name]}"
        if name not in model.inputs:
            raise RecordError(f"{said}: {name} is measured, no input; allowed: a column, or a formula of columns")
        if not np.isfinite(number[0]):
            raise RecordError(f"{said}: {number[0]:g} is no value of an input; allowed: a finite number")
        found[name] = number
    return found


def _throughout(
    record: Record, chosen: Mapping[str, str], numbers: Mapping[str, tuple[float, str]]
) -> tuple[Record, dict[str, str]]:
    """The record with a signal for every number, and its key."""
    keys = {name: f"{name} = {number:g} throughout" for name, (number, _) in numbers.items()}
    made_of = {keys[n]: Signal(np.full(record.t.shape, v), unit, f"{v:g}") for n, (v, unit) in numbers.items()}
    return replace(record, signals={**record.signals, **made_of}) if made_of else record, {**chosen, **keys}


def _chosen(
    record: Record, model: Model, signals: Mapping[str, str], numbers: Collection[str]
) -> tuple[Record, dict[str, str], list[Note], dict[str, str]]:
    """The record with what the mappings make of its columns; model name -> key in it; notes; model name -> why the
    model's own mapping of it does not hold here. `numbers` need none.
    """
    every = _unique(model.inputs, model.states, model.outputs)
    names = [name for name in every if name not in numbers]
    columns, wanted = record, {name: model.units[name] for name in names}
    record, given, _ = _made(record, _canonical(model, signals, strict=True), wanted, strict=True)
    left = {name: spec for name, spec in _canonical(model, model.signals, strict=False).items() if name not in given}
    record, own, why_not = _made(record, left, wanted, strict=False)
    chosen: dict[str, str] = {}
    idle = {name: why for name, why in model.plant.sometimes.items() if name in model.signals and name not in every}
    notes = [Note(f"{model.signals[name]!r} is not used: {why}", "left_out", name) for name, why in idle.items()]
    claimed = {sole(columns, key) for key in (*own.values(), *given.values())}
    joints = dict[str, str]()
    for name in names:
        key = given.get(name) or own.get(name)
        if key is None:
            found = record.find(name, further=False)
            of_joint = None if found else _of_joint(record, name)
            joints |= {name: of_joint} if of_joint and not record.series else {}  # a bag says itself whose it is
            found = found or of_joint or _default(record, model, name, notes)
            key = found if found not in claimed else None  # a column that is said to be something else is that
        if key is not None:
            chosen[name] = key
        if name in why_not:
            instead = f"; {key!r} is used" if key else ""
            advice = instead or by_number(columns, name, left[name])
            said = f"the model's signals map {name} to {left[name]!r}, which is not in this record{advice}"
            notes.append(Note(said, "missing", name))
    for alias in ALIASES:
        target = _alias(model, alias)
        if target is None or target in chosen or target in numbers:
            continue
        try:
            found = record.find(alias)
        except RecordError as error:
            notes.append(Note(f"{error}: none is taken as {target}", "left_out", target))
            continue
        if found is not None and found not in chosen.values():
            chosen[target] = found
    _check_once(columns, chosen)
    return record, chosen, [*notes, *_told_joints(record, joints)], why_not


def _check_once(record: Record, chosen: Mapping[str, str]) -> None:
    """Refuse one column that is said to be two signals."""
    taken: dict[str, str] = {}
    for name, spec in chosen.items():
        column = sole(record, spec)
        if column is not None and column in taken:
            label = record.labels[column]
            both = f"the column {label!r} is read as {taken[column]} and as {name}"
            raise RecordError(
                f"{record.source}: {both}; allowed: a column is one signal. Map one of them to another one"
            )
        if column is not None:
            taken[column] = name


def _made(
    record: Record, specs: Mapping[str, str], wanted: Mapping[str, str], strict: bool
) -> tuple[Record, dict[str, str], dict[str, str]]:
    """The record with all that `specs` say; model name -> key; model name -> why it is not there, unless that is
    refused (`strict`).

    `wanted`: name -> the model's unit.
    """
    found, missing = {}, {}
    for name, spec in specs.items():
        if name not in wanted:
            continue
        try:
            record, found[name] = made(record, name, spec, wanted[name])
        except RecordError as error:
            if strict:
                raise
            missing[name] = str(error)
    return record, found, missing


def _canonical(model: Model, signals: Mapping[str, str], strict: bool) -> dict[str, str]:
    """A mapping with the model's own names for keys, without those for the time column.

    `strict` refuses a name that the model does not have; the model's own mapping may have more than it uses.
    """
    result: dict[str, str] = {}
    for key, spec in signals.items():
        name = None if key in TIME_KEYS else _name(model, key, spec, strict)
        if name is None:
            continue
        if name in result:
            raise RecordError(f"signals map {name} twice, to {result[name]!r} and to {spec!r}")
        result[name] = spec
    return result


def _name(model: Model, key: str, spec: str, strict: bool) -> str | None:
    try:
        return model.canonical(key)
    except ModelError as error:
        if not strict:
            return None
        number = re.fullmatch(r"\s*[-+]?[\d.]+(?:[eE][-+]?\d+)?\s*", spec)
        sizes = f"; parameters, which --set sets: {', '.join(parameters_of(model))}" if number else ""
        raise ModelError(f"signal {key}={spec}: {error}{sizes}") from None


def _of_joint(record: Record, name: str) -> str | None:
    """The key of ``elbow.position`` in a JointState: ``/joint_states.position[elbow]``,
    ``/joint_states/elbow/position``, ``position_1`` beside ``name_1`` that says ``elbow`` throughout; or in a table of
    joints, ``elbow_pos``. Where one column has it.
    """
    joint, _, quantity = name.rpartition(".")
    if not joint:
        return None
    numbered = {
        f"{match['stem']}{quantity}{match['number']}"
        for label, word in record.words.items()
        if word == joint and (match := _NAME_OF.match(label))
    }
    ends = (f".{quantity}[{joint}]", f"/{joint}/{quantity}")
    words = {f"{joint}{mark}{word}".lower() for mark in ("_", "/", " ", "-") for word in _JOINT_WORDS.get(quantity, ())}
    labels = record.labels
    for found in (
        [key for key, label in labels.items() if label.endswith(ends)],
        [key for key, label in labels.items() if label in numbered],
        [key for key, label in labels.items() if heading(label).name.lower() in words],
    ):
        if found:
            return found[0] if len(found) == 1 else None
    return None


def _told_joints(record: Record, found: Mapping[str, str]) -> list[Note]:
    """What is said of signals of joints that are called otherwise in the record."""
    pairs = [f"{name} is {record.labels[key]!r}" for name, key in found.items()]
    more = f" and {len(pairs) - 3} more" if len(pairs) > 3 else ""
    return [Note(f"found by the joints' names: {', '.join(pairs[:3])}{more}", "assumed")] if pairs else []


def _default(record: Record, model: Model, name: str, notes: list[Note]) -> str | None:
    """The key of a state or input in a ``/state`` or ``/input`` array in the model's order."""
    for role, names in (("state", tuple(model.states)), ("input", tuple(model.inputs))):
        entries = _entries(record, role, names)
        if name in names and names.index(name) < len(entries):
            if len(entries) != len(names) and name == names[0]:
                taken = ", ".join(names[: len(entries)])
                said = f"/{role} has {len(entries)} values, the model {len(names)}: the first are {taken}"
                notes.append(Note(said, "assumed", name))
            return entries[names.index(name)]
    return None


def _entries(record: Record, role: str, names: tuple[str, ...]) -> list[str]:
    """Keys of the elements of the only array topic called /state or /input, in order; none if labels name the
    elements.
    """
    found: dict[str, dict[int, str]] = {}
    for key, signal in record.signals.items():
        match = _DEFAULT_TOPIC.match(signal.label)
        if match and match["role"] == role:
            found.setdefault(match["topic"], {})[int(match["index"])] = key
    if len(found) != 1:
        return []
    (elements,) = found.values()
    if set(names) & set(elements.values()):
        return []
    return [elements[i] for i in sorted(elements)]


def _alias(model: Model, alias: str) -> str | None:
    """What an alias stands for in this model, if anything; an effort is a force or a torque, nothing else."""
    try:
        name = model.canonical(alias)
    except ModelError:
        return None
    if name not in model.units or (alias == "effort" and units.conversion("N·m", model.units[name]) is None):
        return None
    return name


def _velocity_of(model: Model, chosen: Collection[str]) -> dict[str, str]:
    """An imposed motion recorded as displacement only: the input velocity is derived from it."""
    if "velocity" in model.inputs and "velocity" not in chosen and "displacement" in chosen:
        return {"velocity": "displacement"}
    return {}


def _aligned(record: Record, model: Model, chosen: Mapping[str, str], base: str | None) -> Record:
    """A bag's chosen signals on the stamps of the fastest measured one, inputs held; other records as they
    are.
    """
    if not record.series or not chosen:
        return record
    inputs = {chosen[name] for name in model.inputs if name in chosen}
    used = {key: record.series[key] for key in dict.fromkeys(chosen.values())}
    try:
        if base is not None:
            base = named(record.series, base)
            used.setdefault(base, record.series[base])
        one = align(used, inputs, base)
    except RecordError as error:
        raise RecordError(f"{record.source}: {error}") from None
    kept = [note for note in record.notes if note not in record.alignment]
    others = {
        key: Signal(np.full(one.t.shape, np.nan), label=other.label)
        for key, other in record.series.items()
        if key not in used
    }
    signals, notes = {**one.signals, **others}, (*kept, *one.notes)
    return replace(record, t=one.t, signals=signals, notes=notes, alignment=one.notes, acts=one.acts, rows=None)


def _first_state(measured: Mapping[str, Array], states: tuple[str, ...]) -> Array | None:
    if not all(name in measured and measured[name].size and np.isfinite(measured[name][0]) for name in states):
        return None
    return frozen(np.array([measured[name][0] for name in states]))
