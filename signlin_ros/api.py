"""The verbs for Python: what `signlin` does on the command line, with records from files or from memory.

Every verb takes a model (a `Model`, a model file, or the name of a shipped one) and records (paths, `ModelData`, a
table with one column for each signal, or a list of these). Records are checked first, as on the command line.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np

from signlin_ros.control import CONTROL_PERIOD
from signlin_ros.errors import InputError

if TYPE_CHECKING:
    from signlin_ros.checks.finding import Finding
    from signlin_ros.control.law import ControlLaw
    from signlin_ros.diagnosis.compared import Comparison
    from signlin_ros.diagnosis.results import Diagnosis
    from signlin_ros.model import Model
    from signlin_ros.observe.observer import KalmanObserver
    from signlin_ros.records import ModelData

    ModelLike = Model | str | os.PathLike[str]
Progress = Callable[[str, float], None]


# --------------------------------------------------------------------------- models and records


def _model(model: Any) -> Model:
    from signlin_ros.model import Model

    return model if isinstance(model, Model) else Model.load(model)


def _is_table(data: Any) -> bool:
    """Tell whether data is a table: a mapping of columns, or a pandas DataFrame."""
    return isinstance(data, Mapping) or hasattr(data, "columns")


def _of_table(table: Any, model: Model, signals: Mapping[str, str] | None, source: str = "table") -> ModelData:
    """Return a record from columns (T,) by name (``speed``, ``speed [rpm]``), one of them the time ``t`` in s."""
    from signlin_ros.records import Record, Signal
    from signlin_ros.records.header import heading

    heads = {str(name): heading(str(name)) for name in table}
    time = next((name for name, head in heads.items() if head.time and head.time[1] in ("", "s")), None)
    if time is None:
        raise InputError(f"the table has no column 't' in s; it has {', '.join(heads) or 'no columns'}")
    columns = {str(name): np.asarray(table[name], dtype=float) for name in table}
    rest = {h.name: Signal(columns[name], h.unit, name) for name, h in heads.items() if name != time}
    return Record(columns[time], rest, source=source).for_model(model, signals)


def _records(
    model: Model,
    data: Any,
    validation: Any,
    signals: Mapping[str, str] | None,
    cures: Sequence[str],
    hold_out: Mapping[str, float] | None = None,
) -> tuple[Model, list[ModelData], list[ModelData] | None, list[Finding]]:
    """Return the model as the records need it, training and validation data, and what the checks found."""
    from signlin_ros.follow.data import load_sides
    from signlin_ros.guard import check_sides
    from signlin_ros.records.conditions import held_apart

    first, second = _listed(data), [] if validation is None else _listed(validation)
    if not first:
        raise InputError("at least one record is needed")
    if all(isinstance(item, (str, os.PathLike)) for item in (*first, *second)):
        model, first, second = load_sides(model, first, second, signals)  # type: ignore[assignment]
    else:
        model = _with_position(model, [*first, *second])
        sides, several = (first, second), len(first) + len(second) > 1
        numbers = count(1)
        first, second = (
            [_record(model, item, signals, f"table {next(numbers)}" if several else "table") for item in side]
            for side in sides
        )
    if hold_out:
        first, second = held_apart(first, second, hold_out)
    known, unseen, findings = check_sides(model, first, second or None, cures)
    return model, known, unseen, findings


def _record(model: Model, item: Any, signals: Mapping[str, str] | None, table: str) -> ModelData:
    """Return one record in the model's terms; ``table``: what one without a name of its own is called."""
    from signlin_ros.records import ModelData, Record, read_for_model

    if isinstance(item, ModelData):
        return item
    if isinstance(item, Record):
        return item.for_model(model, signals)
    if _is_table(item):
        return _of_table(item, model, signals, table)
    if isinstance(item, (str, os.PathLike)):
        return read_for_model(item, model, signals)
    raise InputError(f"a record is a path, a table of columns, a Record or ModelData; found {type(item).__name__}")


def _with_position(model: Model, items: Sequence[Any]) -> Model:
    """Return a model whose position is a state where every table holds it."""
    name = model.plant.position
    wanted = model.plant.position_optional and name not in model.states
    return model.with_options(with_position=True) if wanted and all(_holds(item, name) for item in items) else model


def _holds(item: Any, name: str) -> bool:
    from signlin_ros.records import Record
    from signlin_ros.records.header import heading

    columns = item.signals if isinstance(item, Record) else item if _is_table(item) else ()
    return any(heading(str(column)).matches(name) for column in columns)


def _listed(data: Any) -> list[Any]:
    """Return records given one by one or in a sequence as a list."""
    from signlin_ros.records import ModelData, Record

    single = isinstance(data, (str, os.PathLike, ModelData, Record)) or _is_table(data)
    return [data] if single else list(data)


# --------------------------------------------------------------------------- verbs


def check(
    model: ModelLike, data: Any, *, signals: Mapping[str, str] | None = None, cures: Sequence[str] = ()
) -> list[Finding]:
    """Return findings on records: errors of units, signs, clocks and sensors.

    Parameters
    ----------
    model : Model, str or path
        The model, its file, or the name of a shipped one (``"dc_motor"``).
    data : path, mapping or DataFrame of columns, Record, ModelData, or a sequence of these
        The records; times in s.
    signals : mapping, optional
        The model's names to columns or formulas: ``{"speed": "omega [rpm]"}``.
    cures : sequence of str, optional
        Names of cures to apply, as findings offer them.

    Returns
    -------
    list of Finding
        Each with ``check``, ``channel``, ``severity`` (note, offer or refuse), ``sentence``, ``cure``.

    Raises
    ------
    ModelError, RecordError
        The model or a record cannot be read.
    """
    from signlin_ros.checks.run import NO_CURE
    from signlin_ros.checks.run import check as run

    loaded, first, _, _ = _records(_model(model), data, None, signals, [NO_CURE])
    return run(loaded, first, cures)[1]


def compare(
    model: ModelLike,
    data: Any,
    validation: Any = None,
    *,
    horizon: float | None = None,
    hold_out: Mapping[str, float] | None = None,
    signals: Mapping[str, str] | None = None,
    cures: Sequence[str] = (),
) -> Comparison:
    """Compare a model with measurements: how good it is, and where it fails.

    Parameters
    ----------
    model : Model, str or path
        The model, its file, or the name of a shipped one.
    data : path, mapping or DataFrame of columns, Record, ModelData, or a sequence of these
        Training data of the refitted base model; the scores are of these records.
    validation : the same, optional
        Validation data; by default the last third of each record.
    horizon : float, optional
        Seconds of the windowed prediction; by default the model's ``update_period``.
    hold_out : mapping, optional
        A known condition, e.g. ``{"kp": 200}``: the records of ``data`` that have it are validation data.
    signals : mapping, optional
        The model's names to columns or formulas; known conditions of a record (``{"a.csv:kp": "200"}``).
    cures : sequence of str, optional
        Names of cures to apply, as findings offer them.

    Returns
    -------
    Comparison
        Scores by channel, inverse (force) error, regions where the error is concentrated, residual tests.

    Raises
    ------
    RecordError
        A record holds nothing that the model predicts, or a check refuses it.
    """
    from signlin_ros.diagnosis.comparison import compare as run

    loaded, first, second, _ = _records(_model(model), data, validation, signals, cures, hold_out)
    return run(loaded, first, horizon, None, second)


def diagnose(
    model: ModelLike,
    data: Any,
    validation: Any = None,
    *,
    hold_out: Mapping[str, float] | None = None,
    signals: Mapping[str, str] | None = None,
    cures: Sequence[str] = (),
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Name the physical effects that a model lacks, or say why none can be named.

    Parameters
    ----------
    model : Model, str or path
        The model, its file, or the name of a shipped one.
    data, validation : path, mapping or DataFrame of columns, Record, ModelData, or a sequence of these
        Training data; validation data, by default the last third of each record.
    hold_out : mapping, optional
        A known condition, e.g. ``{"kp": 200}``: the records of ``data`` that have it are validation data.
    signals : mapping, optional
        The model's names to columns or formulas; known conditions of a record (``{"a.csv:kp": "200"}``).
    cures : sequence of str, optional
        Names of cures to apply, as findings offer them.
    jobs : int, optional
        Threads.
    progress : callable, optional
        Called with the stage and the share of the work that is done.

    Returns
    -------
    Diagnosis
        ``verdict`` (adequate, missing, unexplained), ``sentence``, ``ranking``, ``ladder``, ``parameters``, ``model``.

    Raises
    ------
    RecordError
        A record cannot be used, or a check refuses it.

    Notes
    -----
    Equation-error and output-error estimates have to agree on validation data: docs/understand/method.md.
    """
    from signlin_ros.diagnosis.verbs import diagnose as run

    loaded, first, second, _ = _records(_model(model), data, validation, signals, cures, hold_out)
    return run(loaded, first, second, jobs=jobs, progress=progress)


def add(
    effect: str,
    model: ModelLike,
    data: Any,
    validation: Any = None,
    *,
    hold_out: Mapping[str, float] | None = None,
    signals: Mapping[str, str] | None = None,
    cures: Sequence[str] = (),
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Add one effect of the catalogue and fit it, whatever it is worth.

    Parameters
    ----------
    effect : str
        Its name, e.g. ``"coulomb_friction"``; `catalogue` lists them.
    model : Model, str or path
        The model, its file, or the name of a shipped one.
    data, validation : path, mapping or DataFrame of columns, Record, ModelData, or a sequence of these
        Training data; validation data, by default the last third of each record.
    hold_out : mapping, optional
        A known condition, e.g. ``{"kp": 200}``: the records of ``data`` that have it are validation data.
    signals : mapping, optional
        The model's names to columns or formulas; known conditions of a record (``{"a.csv:kp": "200"}``).
    cures : sequence of str, optional
        Names of cures to apply, as findings offer them.
    jobs : int, optional
        Threads.
    progress : callable, optional
        Called with the stage and the share of the work that is done.

    Returns
    -------
    Diagnosis
        The ladder holds the errors before and after; ``model`` has the effect.

    Raises
    ------
    ModelError, InputError
        The effect is unknown, or does not apply to the plant.
    """
    from signlin_ros.diagnosis.verbs import add as run

    loaded, first, second, _ = _records(_model(model), data, validation, signals, cures, hold_out)
    return run(effect, loaded, first, second, jobs=jobs, progress=progress)


def refine(
    model: ModelLike,
    data: Any,
    validation: Any = None,
    *,
    hold_out: Mapping[str, float] | None = None,
    signals: Mapping[str, str] | None = None,
    cures: Sequence[str] = (),
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Diagnose, and add what is missing until nothing more is confirmed.

    Parameters
    ----------
    model : Model, str or path
        The model, its file, or the name of a shipped one.
    data, validation : path, mapping or DataFrame of columns, Record, ModelData, or a sequence of these
        Training data; validation data, by default the last third of each record.
    hold_out : mapping, optional
        A known condition, e.g. ``{"kp": 200}``: the records of ``data`` that have it are validation data.
    signals : mapping, optional
        The model's names to columns or formulas; known conditions of a record (``{"a.csv:kp": "200"}``).
    cures : sequence of str, optional
        Names of cures to apply, as findings offer them.
    jobs : int, optional
        Threads.
    progress : callable, optional
        Called with the stage and the share of the work that is done.

    Returns
    -------
    Diagnosis
        ``model`` is the refined model; the last of ``notes`` says why it stopped.

    Raises
    ------
    RecordError
        A record cannot be used, or a check refuses it.
    """
    from signlin_ros.diagnosis.verbs import refine as run

    loaded, first, second, _ = _records(_model(model), data, validation, signals, cures, hold_out)
    return run(loaded, first, second, jobs=jobs, progress=progress)


# --------------------------------------------------------------------------- control


def gains(
    model: ModelLike,
    at: Mapping[str, float] | None = None,
    *,
    period: float = CONTROL_PERIOD,
    delay: float | None = None,
    bandwidth: float | None = None,
) -> dict[str, Any]:
    """Return feedback gains and feed-forward constants (kS, kV, kA, kP, kG) of a drive.

    Parameters
    ----------
    model : Model, str or path
        The model of a motor or a mass.
    at : mapping, optional
        An operating point by state, e.g. ``{"speed": 20.0}``; by default shares of the largest speed.
    period, delay : float
        Seconds between updates; the longest from a sample until its input acts in s (default: one period, and the
        model's own). The law holds with every shorter delay, too.
    bandwidth : float, optional
        Of the loop in rad/s; by default 0.8 / (period + delay).

    Returns
    -------
    dict
        The object of ``signlin gains --json`` (schemas/gains.json), with units.

    Raises
    ------
    InputError
        The plant has no gains, or a name in ``at`` is unknown.
    """
    from signlin_ros.control.gains import Wishes, gains_content

    return gains_content(_model(model), dict(at or {}), Wishes(period, delay, bandwidth=bandwidth))


def observer(model: ModelLike, channels: Sequence[str], noise: Mapping[str, float] | None = None) -> KalmanObserver:
    """Return an extended Kalman filter of a model that takes samples as they come.

    Parameters
    ----------
    model : Model, str or path
        The model.
    channels : sequence of str
        Names of the measured states.
    noise : mapping, optional
        Standard deviation of each channel's noise in its unit; measured along the way where not given.

    Returns
    -------
    KalmanObserver
        See its methods ``take``, ``estimate`` and ``record``.

    Raises
    ------
    InputError
        A channel is no state of the model.
    """
    from signlin_ros.observe.observer import KalmanObserver

    return KalmanObserver(_model(model), channels, noise)


def controller(
    model: ModelLike,
    *,
    speed: float,
    limit: float,
    position: bool = False,
    period: float = CONTROL_PERIOD,
    delay: float | None = None,
    design: str = "along_reference",
) -> ControlLaw:
    """Return the feedback law of a design, as the node `controller` runs it.

    Parameters
    ----------
    model : Model, str or path
        The model of the drive.
    speed, limit : float
        Largest speed of the references, largest absolute input, in the model's units.
    position : bool
        Whether the position is tracked, else the speed.
    period, delay : float
        Seconds between updates; the longest from a sample until its input acts in s (default: one period, and the
        model's own). The law holds with every shorter delay, too.
    design : str
        A name of `signlin_ros.control.designs.DESIGNS`.

    Returns
    -------
    Law
        Gains over a grid of speeds; ``signlin_ros.control.law.RunningLaw`` steps it.

    Raises
    ------
    InputError
        The design is unknown, or no bandwidth holds with this period and delay.
    """
    from signlin_ros.control.controller import ControllerSettings
    from signlin_ros.control.designs import find_design

    settings = ControllerSettings(limit, design, position, period, delay or 0.0, speed)
    found, chosen = _model(model), find_design(design)
    task = settings.task(found)
    return chosen.law(found, task, settings.tuning(chosen, found, task))


# --------------------------------------------------------------------------- catalogue


def catalogue() -> dict[str, tuple[str, ...]]:
    """Return the names of all effects and plants.

    Returns
    -------
    dict
        ``{"effects": (...), "plants": (...)}``, sorted; `signlin effects` and `signlin plants` print laws and units.
    """
    from signlin_ros.effects import EFFECTS
    from signlin_ros.plants import PLANTS

    return {"effects": tuple(sorted(EFFECTS)), "plants": tuple(sorted(PLANTS))}


__all__ = [
    "add",
    "catalogue",
    "check",
    "compare",
    "controller",
    "diagnose",
    "gains",
    "observer",
    "refine",
]
