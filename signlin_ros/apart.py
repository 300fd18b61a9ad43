"""Mappings of several records: what holds for all of them, and what is said of one alone, ``run_2.csv:speed``."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import PurePath

from signlin_ros.errors import InputError

MARK = ":"
"""Between the end of a record's path and the name of a signal."""


def of_record(signals: Mapping[str, str] | None, path: str | os.PathLike[str]) -> dict[str, str]:
    """Return the entries of a mapping for one record: ``NAME``, and ``FILE:NAME`` where FILE is the end of its path.

    What is said of the record itself wins.
    """
    parts = [(*split(key), spec) for key, spec in (signals or {}).items()]
    general = {name: spec for file, name, spec in parts if not file}
    return general | {name: spec for file, name, spec in parts if file and _ends(path, file)}


def together(signals: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Return one mapping that says the same as those of several records, by path: ``FILE:NAME`` where they differ."""
    paths = list(signals)
    found: dict[str, str] = {}
    for name in dict.fromkeys(name for own in signals.values() for name in own):
        specs = [own.get(name) for own in signals.values()]
        if len(set(specs)) == 1:
            found[name] = str(specs[0])
            continue
        said = zip(paths, specs, strict=True)
        found |= {f"{_shortest(path, paths)}{MARK}{name}": spec for path, spec in said if spec is not None}
    return found


def check_given(signals: Mapping[str, str], paths: Iterable[str | os.PathLike[str]], option: str = "--signal") -> None:
    """Raise `InputError` where something is said of a record that is not among those given."""
    paths = list(paths)
    for key, spec in signals.items():
        file, _ = split(key)
        if file and not any(_ends(path, file) for path in paths):
            given = ", ".join(os.fspath(path) for path in paths)
            raise InputError(f"{option} {key}={spec}: no record {file!r} is given; there are: {given}")


def split(key: str) -> tuple[str, str]:
    """Return the file, "" for all, and the name of a key of a mapping."""
    file, _, name = key.rpartition(MARK)
    return file.strip(), name.strip()


def _ends(path: str | os.PathLike[str], file: str) -> bool:
    wanted = PurePath(file).parts
    return PurePath(path).parts[-len(wanted) :] == wanted


def _shortest(path: str, paths: Iterable[str]) -> str:
    """Return the shortest end of a path that is no other path's."""
    parts, others = PurePath(path).parts, [other for other in paths if other != path]
    for count in range(1, len(parts)):
        end = str(PurePath(*parts[-count:]))
        if not any(_ends(other, end) for other in others):
            return end
    return str(path)


__all__ = ["check_given", "of_record", "split", "together"]
