"""Named arrays: MATLAB files with vectors, matrices and structs of them, through scipy.io, and h5py where they are of
version 7.3; other HDF5 files; NumPy's .npz.

Simulink's ways to write are known: structures with time, a matrix whose first row is the time (To File), ``u``, ``y``
and the sampling time ``Ts``.
"""

from __future__ import annotations

import math
import re
import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import MissingExtraError, RecordError
from signlin_ros.records import limits
from signlin_ros.records.clean import RawTable
from signlin_ros.records.formats import modelica
from signlin_ros.records.grammar import words
from signlin_ros.records.header import TIME_KEYS, Heading, clock, heading, names_a_time
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Rows, listing

Array = npt.NDArray[np.float64]

_STEPS = ("ts", "dt", "sampletime", "sample_time", "sampling_time", "tsample", "t_s", "samplingtime")
"""What a sampling time in s may be called, in small letters."""
_OWN_TIME = re.compile(r"\.(?:time|times|timestamps?|t|stamps?)\Z", re.IGNORECASE)
HDF = (".h5", ".hdf5")
SAME_TIME_SHARE = 0.01
"""Times that differ by less than this share of a step are taken for the same."""


def read_table(path: Path, source: str, signals: Mapping[str, str]) -> RawTable:
    """Read the vectors that are as long as the time vector.

    A field of a struct is called ``data.speed``, and ``speed`` for short; the columns of a matrix ``q[0]``,
    ``q[1]``; a signal of Simulink as its structure. What else there is (scalars, text, complex numbers, vectors of
    another length) is left out with a note.

    Raises
    ------
    RecordError
        Not such a file, no time vector.
    """
    return table_of(_load(path, source), source, signals)


def table_of(variables: Mapping[str, Any], source: str, signals: Mapping[str, str]) -> RawTable:
    """Return named arrays, structs of them as mappings, as a table: see `read_table`."""
    found = _own_times(_first_rows(_one_time(_flat(dict(_variables(variables)))), signals), signals)
    out = {name: why for name, why in ((name, _no_vector(value)) for name, value in found.items()) if why}
    vectors = {name: value.astype(np.float64) for name, value in found.items() if name not in out}
    headings = _headings(list(vectors))
    time, step = _time(headings, signals) or _called_a_time(vectors, headings), _step(found)
    if time is not None and max(vectors[time.label].shape) != vectors[time.label].size:
        time = None
    if time is None and step is None and not _even(signals):
        raise RecordError(
            f"{source}: no time vector (t, time, timestamp or stamp) and no sampling time Ts; {listing(found)}; "
            "map one with --signal t=NAME, or say --dt 0.01 where the samples are 0.01 s apart"
        )
    length, columns = _length(vectors, time), []
    for head in headings:
        parts = _columns(head, vectors[head.label], length)
        columns += parts
        if not parts:
            shape = "x".join(map(str, vectors[head.label].shape))
            out[head.label] = f"{shape}, the time has {length} values"
    rows = Rows(np.arange(1, length + 1))
    heads = [_told(head) for head, _ in columns]
    if step is not None and step[0] in out:
        del out[step[0]]
    return RawTable(source, heads, [values for _, values in columns], rows, _notes(out), step=step)


def _one_time(found: dict[str, Any]) -> dict[str, Any]:
    """The variables with one time for all signals of Simulink that have the same."""
    times = {name: np.asarray(value) for name, value in found.items() if name.endswith(".time")}
    if len(times) < 2:
        return found
    first = next(iter(times.values()))
    same = [name for name, value in times.items() if np.array_equal(value, first)]
    return {"time": first, **{name: value for name, value in found.items() if name not in same}}


def _flat(found: dict[str, Any]) -> dict[str, Any]:
    """The variables, arrays with sides of one without these: [3 x 1 x samples] is [3 x samples]."""
    flat = {name: np.squeeze(v) if isinstance(v, np.ndarray) and v.ndim > 2 else v for name, v in found.items()}
    return {name: v if np.ndim(v) else found[name] for name, v in flat.items()}


def _own_times(found: dict[str, Any], signals: Mapping[str, str]) -> dict[str, Any]:
    """The variables, where every structure has times of its own: with one ``time`` where these are the same, or where
    the others are interpolated at those that are mapped, or of which there are most.
    """
    times = {n: np.asarray(v) for n, v in found.items() if "." in n and _OWN_TIME.search(n) and not _no_vector(v)}
    if len(times) < 2:
        return found
    spec = next((signals[key].strip() for key in signals.keys() & TIME_KEYS), "")
    chosen = next((n for n in times if spec and n in (spec, f"{spec}.{n.rsplit('.', 1)[-1]}")), "")
    base = times[chosen or max(times, key=lambda n: times[n].size)].reshape(-1).astype(np.float64)
    rest = {n: v for n, v in found.items() if n not in times}
    for name, t in times.items():
        own = t.reshape(-1).astype(np.float64)
        if own.size == base.size and np.allclose(
            own, base, rtol=0.0, atol=SAME_TIME_SHARE * float(np.median(np.diff(base)))
        ):
            continue
        stem = name.rsplit(".", 1)[0]
        for other in [n for n in rest if n.startswith(f"{stem}.") and own.size in np.shape(rest[n])]:
            rest[other] = _at(base, own, np.asarray(rest[other], dtype=np.float64))
    return {**rest, chosen or "time": base}


def _at(base: Array, own: Array, values: Array) -> Array:
    """The values of a vector or matrix with times (N,), interpolated at others (T,)."""
    table = np.atleast_2d(values if values.shape[-1] == own.size else values.T)
    moved = np.stack([np.interp(base, own, row, left=np.nan, right=np.nan) for row in table])
    return moved[0] if len(moved) == 1 else moved


def _told(head: Heading) -> Heading:
    """A heading with the unit that its name ends with."""
    told = heading(head.name)
    return Heading(head.label, told.name, told.unit, told.suffix) if told.suffix else head


def _even(signals: Mapping[str, str]) -> bool:
    """Whether the mapping says how long it is from sample to sample, or makes the time of columns."""
    spec = next((signals[key] for key in signals.keys() & TIME_KEYS), "")
    return bool(spec) and (not words(spec) or not spec.replace(".", "").replace("_", "").isalnum())


def _step(found: Mapping[str, Any]) -> tuple[str, float] | None:
    """Name and value of a sampling time in s."""
    for name, value in found.items():
        short = name.rsplit(".", 1)[-1].lower()
        if short in _STEPS and np.size(value) == 1 and np.isreal(value).all() and np.asarray(value).dtype.kind in "fiu":
            return name, float(np.asarray(value).reshape(-1)[0])
    return None


def _length(vectors: Mapping[str, Array], time: Heading | None) -> int:
    """How many samples there are: as the time has, else as most vectors have."""
    if time is not None:
        return int(vectors[time.label].size)
    return Counter(max(value.shape) for value in vectors.values()).most_common(1)[0][0] if vectors else 0


def _first_rows(found: dict[str, Any], signals: Mapping[str, str]) -> dict[str, Any]:
    """The variables, a lone matrix with increasing times in its first row or column taken apart (To File, loggers)."""
    numbers = {name: value for name, value in found.items() if not _no_vector(value)}
    if len(numbers) != 1 or _time(_headings(list(numbers)), signals) is not None or _step(found) is not None:
        return found
    ((name, matrix),) = numbers.items()
    if matrix.ndim != 2 or min(matrix.shape) < 2 or _even(signals):
        return found
    table = matrix if matrix.shape[0] < matrix.shape[1] else matrix.T
    if not (np.diff(table[0].astype(np.float64)) > 0).all():
        return found
    taken = {f"{name}[{i}]": table[i] for i in range(1, table.shape[0])}
    return {**{key: value for key, value in found.items() if key != name}, "t": table[0], **taken}


def _notes(out: Mapping[str, str]) -> tuple[Note, ...]:
    """Return notes on the variables that are left out, those for the same reason together."""
    notes = []
    for why in dict.fromkeys(out.values()):
        names = [repr(name) for name, its in out.items() if its == why]
        verb = "is left out: it is" if len(names) == 1 else "are left out: each is"
        notes.append(Note(f"{', '.join(names)} {verb} {why}", "left_out"))
    return tuple(notes)


def _load(path: Path, source: str) -> dict[str, Any]:
    if path.suffix.lower() == ".npz":
        return _load_npz(path, source)
    if path.suffix.lower() in HDF:
        return _load_hdf(path, source, "an HDF5 file", "is it damaged, or still open in the program that writes it?")
    from scipy.io import loadmat, whosmat

    try:
        limits.check_size(sum(8 * math.prod(shape) for _, shape, _ in whosmat(str(path))), source)
        found = dict(loadmat(str(path)))
        return modelica.arrays(found) if modelica.is_result(found) else found
    except NotImplementedError:
        kind = "a MAT file of version 7.3 (HDF5; save(..., '-v7') in MATLAB makes one that needs nothing)"
        return _load_hdf(path, source, kind, "save it in MATLAB with save(..., '-v7')")
    except RecordError:
        raise
    except Exception as error:  # scipy raises nearly anything on a damaged file
        raise RecordError(f"{source}: not a readable MAT file ({error})") from error


def _load_npz(path: Path, source: str) -> dict[str, Any]:
    with path.open("rb") as raw:
        try:
            with zipfile.ZipFile(raw) as archive:
                limits.check_names(archive.namelist(), source)
                limits.check_size(sum(info.file_size for info in archive.infolist()), source)
            raw.seek(0)
            with np.load(raw, allow_pickle=False) as file:
                return {name: _npz_value(file, name) for name in file.files}
        except RecordError:
            raise
        except Exception as error:  # numpy raises nearly anything on a damaged file
            raise RecordError(f"{source}: not a readable .npz file ({error})") from error


def _npz_value(file: Any, name: str) -> Any:
    """An array; None for Python objects, which are not loaded."""
    try:
        return file[name]
    except ValueError:
        return None


def _load_hdf(path: Path, source: str, kind: str, advice: str) -> dict[str, Any]:
    """The variables of a HDF5 file; structs and groups as mappings. ``kind``: what it is; ``advice`` if it is not."""
    try:
        import h5py
    except ImportError:
        raise MissingExtraError(f"{source}: {kind}", "formats") from None
    try:
        with h5py.File(path, "r") as file:
            sizes: list[int] = []
            file.visititems(lambda _, item: sizes.append(getattr(item, "nbytes", 0)))
            limits.check_size(sum(sizes), source)
            return {name: _hdf_value(file, value) for name, value in file.items() if not name.startswith("#")}
    except OSError as error:
        raise RecordError(f"{source}: not {kind.split(' (', 1)[0]} that can be read ({error}); {advice}") from error


def _hdf_value(file: Any, value: Any) -> Any:
    """A variable as scipy would give it: transposed, text and references of cells as no numbers."""
    if hasattr(value, "items"):
        return {name: _hdf_value(file, part) for name, part in value.items()}
    kind = value.attrs.get("MATLAB_class", b"")
    if kind == b"char":
        return np.array(["text"])
    if value.dtype.kind == "O":
        parts = [file[reference] for reference in np.asarray(value).reshape(-1)]
        return _hdf_value(file, parts[0]) if len(parts) == 1 else np.array(["cells"])
    if value.dtype.names and value.ndim == 1 and not kind:
        return {name: np.asarray(value[name]) for name in value.dtype.names}
    if value.dtype.names:
        return np.array([1j])
    return np.asarray(value).T


def _variables(variables: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """All variables, structs opened; the values of a Simulink signal under the name of its structure."""
    for name, value in variables.items():
        if name.startswith("__"):
            continue
        fields = _fields(value)
        if fields is None:
            yield prefix + name, value
        elif {"time", "signals"} <= fields.keys() and _each(fields["signals"]):
            yield from _simulink(f"{prefix}{name}", fields)
        else:
            yield from _variables(fields, f"{prefix}{name}.")


def _fields(value: Any) -> Mapping[str, Any] | None:
    """The fields of a struct, None for anything else."""
    if isinstance(value, Mapping):
        return value
    if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
        return {field: value.reshape(-1)[0][field] for field in value.dtype.names}
    return None


def _each(value: Any) -> list[Mapping[str, Any]]:
    """The fields of every struct of an array of them; none of anything else."""
    if isinstance(value, np.ndarray) and value.dtype.names:
        return [{field: one[field] for field in value.dtype.names} for one in value.reshape(-1)]
    return [value] if isinstance(value, Mapping) else []


def _simulink(name: str, fields: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """The time and the values of a structure with time; of several signals each under its label, or its number."""
    if np.size(fields["time"]):
        yield f"{name}.time", fields["time"]
    signals = _each(fields["signals"])
    for number, one in enumerate(signals, 1):
        label = "".join(map(str, np.ravel(one.get("label", ""))[:1])).strip(" <>") or str(number)
        yield name if len(signals) == 1 else f"{name}.{label}", one.get("values", np.empty(0))


def _no_vector(value: Any) -> str:
    """Why a variable is no real vector or matrix, or an empty text."""
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub":
        kind = value.dtype.kind if isinstance(value, np.ndarray) else ""
        return {"c": "complex", "U": "text", "S": "text"}.get(kind, "no array of numbers")
    if value.size < 2:
        return "one number" if value.size else "empty"
    return f"of {value.ndim} dimensions" if value.ndim > 2 else ""


def _headings(labels: list[str]) -> list[Heading]:
    """Short names for the fields of structs, where they are unique."""
    short = [label.rsplit(".", 1)[-1] for label in labels]
    count = Counter(short)
    return [Heading(label, name if count[name] == 1 else label) for label, name in zip(labels, short, strict=True)]


def _time(headings: list[Heading], signals: Mapping[str, str]) -> Heading | None:
    for key in signals.keys() & TIME_KEYS:
        return next((head for head in headings if head.matches(signals[key])), None)
    return clock(headings)


def _called_a_time(vectors: Mapping[str, Array], headings: Sequence[Heading]) -> Heading | None:
    """The first vector that is called as times may be, ``pi_time``, and rises."""
    named = (head for head in headings if names_a_time(head.name))
    return next((head for head in named if _rises(vectors[head.label])), None)


def _rises(values: Array) -> bool:
    return values.size > 1 and max(values.shape) == values.size and bool((np.diff(values.reshape(-1)) > 0).all())


def _columns(head: Heading, values: Array, length: int) -> list[tuple[Heading, Array]]:
    """The (T,) columns of a vector or matrix; none if no side of it is as long as the time."""
    if values.size == length:
        return [(head, values.reshape(-1))]
    if values.ndim < 2 or length not in values.shape:
        return []
    table = values if values.shape[0] == length else values.T
    heads = [Heading(f"{head.label}[{i}]", f"{head.name}[{i}]") for i in range(table.shape[1])]
    return [(part, np.ascontiguousarray(table[:, i])) for i, part in enumerate(heads)]
