"""Variables as GNU Octave saves them unless it is told another format: text, whatever the file is called."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import RecordError

Array = npt.NDArray[np.float64]

BEGINNING = b"# Created by Octave"
"""Of every such file."""
_VARIABLE = re.compile(
    r"^# name: (?P<name>\S+)\n# type: (?P<type>[^\n]+)\n(?P<sizes>(?:# (?:rows|columns): \d+\n)*)", re.MULTILINE
)


def begins(file: Path) -> bool:
    """Tell whether a file begins as such a one."""
    if not file.is_file():  # what comes through a pipe can be read once
        return False
    with file.open("rb") as stream:
        return stream.read(len(BEGINNING)) == BEGINNING


def arrays(text: str, source: str) -> dict[str, Array]:
    """Return numbers, matrices and ranges by name; what is of another type is left out.

    Raises
    ------
    RecordError
        A matrix has other numbers than its header says: the file is cut off.
    """
    found = dict[str, Array]()
    starts = [*_VARIABLE.finditer(text)]
    for match, end in pairwise([*starts, None]):
        assert match is not None  # noqa: S101  only the last is None, and it comes second
        body = text[match.end() : end.start() if end else len(text)]
        sizes = [int(size) for size in re.findall(r"\d+", match["sizes"])]
        if match["type"] == "matrix" and len(sizes) == 2:
            values = np.array(body.split(), dtype=np.float64)
            if values.size != sizes[0] * sizes[1]:
                said = f"{values.size} numbers, {sizes[0]}x{sizes[1]} by its header"
                raise RecordError(f"{source}: the matrix {match['name']!r} has {said}: the file is cut off")
            found[match["name"]] = values.reshape(sizes)
        elif match["type"] == "range":
            base, limit, step = (float(v) for v in re.findall(r"^[^#\n]+", body, re.MULTILINE)[0].split()[:3])
            count = int((limit - base) / step + 1e-9)
            found[match["name"]] = np.linspace(base, base + step * count, count + 1)
        elif match["type"] == "scalar":
            found[match["name"]] = np.array([float(body.split()[0])])
    return found


__all__ = ["arrays", "begins"]
