"""The exception tree.

::

    SignlinError
    ├── InputError (also a ValueError)      what the user gave is bad: one clear line, exit code 2
    │   ├── ModelError                      a model file or a model's structure
    │   ├── EffectError                     the code of somebody's effect
    │   ├── RecordError                     a measurement record
    │   └── SimulationError                 a run that cannot go on (diverged, too stiff)
    └── MissingExtraError (also an ImportError)   an optional dependency; says the install command
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence


class SignlinError(Exception):
    """Base of every error that signlin_ros raises on purpose."""


class InputError(SignlinError, ValueError):
    """What the user gave is bad; the message names the culprit and the choices."""


class ModelError(InputError):
    """A model file, or the structure of a model, is bad."""


class EffectError(InputError):
    """The code of an effect is wrong; the message names the effect, its file and the method."""


class RecordError(InputError):
    """A measurement record is bad, or does not hold what the model needs."""


class SimulationError(InputError):
    """A simulation cannot go on; the message says when and why."""


class MissingExtraError(SignlinError, ImportError):
    """An optional dependency is missing; the message holds the exact install command."""

    def __init__(self, what: str, extra: str) -> None:
        super().__init__(f'{what} needs an optional dependency: pip install "signlin_ros[{extra}]"')


MAX_MESSAGE_LENGTH = 1000
"""Characters of a message that is shown to somebody."""


def one_line(error: object, most: int = MAX_MESSAGE_LENGTH) -> str:
    """Return a message as one line; of one that is too long, its beginning and its end."""
    text = " ".join(str(error).split())
    return text if len(text) <= most else f"{text[: most * 2 // 3]} ... {text[-most // 4 :]}"


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the known name most like ``word``, or None when nothing is near."""
    names = list(known)
    folded = {name.casefold(): name for name in names}
    hits = difflib.get_close_matches(word.casefold(), folded, n=1, cutoff=0.6)
    return folded[hits[0]] if hits else None


def suggest(word: str, known: Iterable[str]) -> str:
    """Return ``"; did you mean 'x'?"`` for the known name most like ``word``, or an empty string."""
    name = nearest(word, known)
    return f"; did you mean {name!r}?" if name else ""


def choices(known: Iterable[str]) -> str:
    """Return the known names as a readable list, each once."""
    return ", ".join(sorted(set(known))) or "(none)"


def joined(words: Sequence[str], last: str = "and") -> str:
    """Return ``"a, b and c"``."""
    return f" {last} ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
