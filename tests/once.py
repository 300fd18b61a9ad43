"""What several tests need and takes long is worked out once, for all tests and all processes of a run.

A result is kept under a digest of what it is made of, in a folder that the run makes at its beginning (tests/conftest)
and removes at its end: the code is the same throughout, and needs no part in the digest.
"""

from __future__ import annotations

import dataclasses
import fcntl
import hashlib
import os
import pickle
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")
FOLDER = "SIGNLIN_TESTS_ONCE"
"""The environment variable that names the folder."""
_here: dict[str, Any] = {}
"""What this process has worked out or read already."""


def once(compute: Callable[..., T], *arguments: Any, **options: Any) -> T:
    """Return ``compute(*arguments, **options)``, which must depend on nothing else; worked out once in a run.

    Models, records and other frozen dataclasses, arrays, mappings, sequences and plain values may be arguments. The
    result must be possible to pickle; it is shared, so leave it as it is.
    """
    key = digest(f"{compute.__module__}.{compute.__qualname__}", arguments, options)
    if key not in _here:
        _here[key] = _on_disk(Path(os.environ[FOLDER]) / key, lambda: compute(*arguments, **options))
    return _here[key]


def _on_disk(path: Path, compute: Callable[[], T]) -> T:
    """Return what is in the file; where it is not there, compute it, while other processes wait for it."""
    with path.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if path.exists():
            return pickle.loads(path.read_bytes())
        result = compute()
        part = path.with_suffix(".part")
        part.write_bytes(pickle.dumps(result))
        part.replace(path)
        return result


def digest(*values: Any) -> str:
    """Return what tells values apart, whatever process they are in."""
    found = hashlib.sha256()
    for value in values:
        for piece in _pieces(value):
            found.update(piece)
    return found.hexdigest()


def _pieces(value: Any) -> Iterator[bytes]:
    yield type(value).__name__.encode() + b"("
    if isinstance(value, np.ndarray):
        yield f"{value.dtype.str}{value.shape}".encode()
        yield value.tobytes()
    elif isinstance(value, types.FunctionType | type):
        yield f"{value.__module__}.{value.__qualname__}".encode()
    else:
        parts = _parts(value)
        if parts is None:
            yield repr(value).encode()
        for part in parts or ():
            yield from _pieces(part)
    yield b")"


def _parts(value: Any) -> list[Any] | None:
    """Return what a value is made of, in order; None where it is plain."""
    if hasattr(value, "to_dict"):  # a model
        return [value.to_dict()]
    if dataclasses.is_dataclass(value):
        return [getattr(value, field.name) for field in dataclasses.fields(value)]
    if isinstance(value, Mapping):
        return [part for pair in value.items() for part in pair]
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return list(value)
    if isinstance(value, set | frozenset):
        return sorted(value, key=repr)
    if type(value).__repr__ is object.__repr__:
        raise TypeError(f"{type(value).__name__} has no digest: its repr names a place in memory")
    return None
