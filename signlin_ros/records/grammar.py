"""What a mapping says a quantity is: a column, or a small formula over columns.

    COLUMN                    sign(dir) * pwm              signbit(load, 10)
    COLUMN [rpm]              -0.10472 * meas_rpm          0.5 * (left + right) - 3
    sec + 1e-9 * nanosec      "pos (5)" * 0.088 [deg]      2 * #3

Numbers, the names of columns (in quotes where they hold signs of the grammar) or their numbers, ``#3``, ``+ - * /``,
brackets, and the functions of `FUNCTIONS`. A unit in square brackets at the end states what the result is in. Nothing
is evaluated as Python.

Units: as long as columns are only added, negated and given a sign, their unit holds. What multiplies by a number states
the conversion itself: the columns' numbers are then taken as they stand, and the result in the unit at the end, or the
model's. A factor of 1 or -1 leaves a unit that can be converted to the model's, and is the conversion of any other.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from signlin_ros.errors import RecordError

Array = npt.NDArray[np.float64]

_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.])")
_WORD = re.compile(r"/?[^\W\d][\w./]*(?:\[[\w/]+\][\w.]*)*|\d+[A-Za-z_]\w*|#\d+")
_UNIT = re.compile(r"\s*\[(?P<unit>[^\[\]]+)\]\s*\Z")
MAX_SHOWN_FORMULA = 60
"""Characters of a formula that a message shows."""
MAX_FORMULA_LENGTH, MAX_FORMULA_FACTORS = 10_000, 200
"""Characters of a formula, and numbers and columns in it."""
MAX_BRACKET_DEPTH = 50
"""Brackets within brackets that a formula may have."""


def _sign(x: Array) -> Array:
    """-1, 0 or 1; of a column that holds nothing but 0 and 1 (a direction pin), 0 is the other direction."""
    there = x[np.isfinite(x)]
    pin = there.size and np.isin(there, (0.0, 1.0)).all() and there.min() < there.max()
    return np.where(np.isnan(x), np.nan, np.where(x > 0, 1.0, -1.0)) if pin else np.sign(x)


def _signbit(x: Array, bit: Array) -> Array:
    """The magnitude below a bit, negative where that is set (as Feetech's servos report)."""
    high = 2.0 ** float(bit)
    return np.where(x >= high, high - x, x)


def _wrapped(bits: int) -> Callable[[Array], Array]:
    """Two's complement of so many bits."""
    half, whole = 2.0 ** (bits - 1), 2.0**bits
    return lambda x: np.mod(x + half, whole) - half


FUNCTIONS: dict[str, tuple[int, Callable[..., Array]]] = {
    "sign": (1, _sign),
    "abs": (1, np.abs),
    "signbit": (2, _signbit),
    "int8": (1, _wrapped(8)),
    "int16": (1, _wrapped(16)),
    "int32": (1, _wrapped(32)),
}
"""Name -> number of arguments, function."""


@dataclass(frozen=True)
class Node:
    """A part of a formula: ``op`` is a number, a column, ``neg``, ``+ - * /`` or a function's name."""

    op: str
    parts: tuple[Node, ...] = ()
    name: str = ""
    value: float = 0.0

    def columns(self) -> Iterator[str]:
        """The keys of the columns in it, each as often as it stands there."""
        if self.op == "column":
            yield self.name
        for part in self.parts:
            yield from part.columns()

    @property
    def constant(self) -> bool:
        """Whether it holds no column."""
        return next(self.columns(), None) is None

    @property
    def affine(self) -> bool:
        """Whether it is a sum of columns times numbers, and of numbers."""
        if self.op in ("number", "column"):
            return True
        if self.op in FUNCTIONS:
            return self.constant
        if self.op == "*" and not any(part.constant for part in self.parts):
            return False
        if self.op == "/" and not self.parts[1].constant:
            return False
        return all(part.affine for part in self.parts)

    def evaluate(self, columns: Mapping[str, Array]) -> Array:
        """The values (T,), or one number where it is constant."""
        if self.op == "number":
            return np.asarray(self.value)
        if self.op == "column":
            return columns[self.name]
        values = [part.evaluate(columns) for part in self.parts]
        if self.op in FUNCTIONS:
            return FUNCTIONS[self.op][1](*values)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.asarray(_OPERATIONS[self.op](*values), dtype=np.float64)

    def undefined(self, columns: Mapping[str, Array]) -> npt.NDArray[np.bool_]:
        """Where it divides by zero, (T,); one truth value where it divides by no column."""
        found = [part.undefined(columns) for part in self.parts]
        if self.op == "/":
            found.append(np.asarray(self.parts[1].evaluate(columns) == 0.0))
        return functools.reduce(np.logical_or, found, np.zeros((), dtype=np.bool_))

    def unit(self, units: Mapping[str, str], ones: bool = True) -> str | None:
        """The unit of the result as the columns state it: "" where a number states the conversion, None where two
        units are added. `ones`: a factor of 1 or -1 leaves the unit; else it is a conversion as any other.
        """
        if self.op == "number":
            return ""
        if self.op == "column":
            return units[self.name]
        found = [part.unit(units, ones) for part in self.parts if not part.constant]
        if None in found:
            return None
        if self.op == "sign":
            return ""
        if self.op in ("*", "/"):
            factors = [part for part in self.parts if part.constant]
            kept = all(ones and abs(float(part.evaluate({}))) == 1.0 for part in factors)
            stated = [one for one in found if one]
            whole = len(stated) == 1 and (self.op == "*" or bool(self.parts[0].unit(units)))
            return stated[0] or "" if kept and whole else ""
        different = {one for one in found if one}
        return None if len(different) > 1 else next(iter(different), "")


_OPERATIONS: dict[str, Callable[..., Array]] = {
    "neg": np.negative,
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
}


def split_unit(spec: str) -> tuple[str, str]:
    """``speed = meas [rpm]``: the text before a unit in square brackets at the end, and that unit, or "".

    The brackets of ``/cmd.data[0]`` and ``velocity[wheel]``, which nothing separates from the name, are none.
    """
    match = _UNIT.search(spec)
    if match is None or not match.start() or not (spec[match.start()].isspace() or spec[match.start() - 1] in ")\"'"):
        return spec, ""
    return spec[: match.start()].strip(), match["unit"].strip()


def words(spec: str) -> list[str]:
    """All that may be a column's name in a formula: ``-2 * /cmd.data[0] + u`` has ``/cmd.data[0]`` and ``u``."""
    body, _ = split_unit(spec)
    quoted = re.findall(r"[\"'`]([^\"'`]+)[\"'`]", body)
    found = [match[0].rstrip("./") for match in _WORD.finditer(re.sub(r"[\"'`][^\"'`]*[\"'`]", " ", body))]
    divided = [word for word in found if "/" in word and not (word.startswith("/") and "." in word)]
    parts = [part for word in divided for part in word.split("/") if part[:1].isalpha()]
    return quoted + [word for word in (*found, *parts) if word not in FUNCTIONS]


def is_formula(spec: str) -> bool:
    """Whether a text looks like a formula rather than like a name."""
    body, _ = split_unit(spec)
    return bool(re.search(r"[*+()\"'`]|(?<![\w/])-|\s[-/]\s|^\s*\.?\d", body))


def parse(text: str, names: Mapping[str, str], where: str) -> Node:
    """The formula in `text`.

    Parameters
    ----------
    names : what a column may be called -> its key.
    where : ``signal speed``, for messages.

    Raises
    ------
    RecordError
        With the place in the formula, and what it does not know.
    """
    parser = _Parser(text, dict(sorted(names.items(), key=lambda pair: -len(pair[0]))), where)
    if len(text) > MAX_FORMULA_LENGTH:
        raise parser.fault(f"{len(text):,} characters; allowed: {MAX_FORMULA_LENGTH:,}")
    return parser.whole()


@dataclass
class _Parser:
    """Recursive descent over `text`; `names` are tried from the longest on."""

    text: str
    names: Mapping[str, str]
    where: str
    at: int = 0
    depth: int = field(default=0)
    count: int = field(default=0)

    def whole(self) -> Node:
        node = self.sum()
        self.blank()
        if self.at < len(self.text):
            raise self.fault(f"{self.text[self.at : self.at + MAX_SHOWN_FORMULA]!r} is left over")
        return node

    def fault(self, why: str) -> RecordError:
        known = "numbers, columns, + - * / ( ), " + ", ".join(FUNCTIONS)
        shown = self.text if len(self.text) <= MAX_SHOWN_FORMULA else f"{self.text[:MAX_SHOWN_FORMULA]} ..."
        return RecordError(f"{self.where}: {shown!r}: {why}; allowed: {known}")

    def blank(self) -> None:
        while self.at < len(self.text) and self.text[self.at].isspace():
            self.at += 1

    def taken(self, marks: str) -> str:
        """Take one of `marks` if it comes next."""
        self.blank()
        if self.at < len(self.text) and self.text[self.at] in marks:
            self.at += 1
            return self.text[self.at - 1]
        return ""

    def sum(self) -> Node:
        return self.chain("+-", self.product)

    def product(self) -> Node:
        return self.chain("*/", self.factor)

    def chain(self, marks: str, part: Callable[[], Node]) -> Node:
        node = part()
        while mark := self.taken(marks):
            node = Node(mark, (node, part()))
        return node

    def factor(self) -> Node:
        mark = self.taken("+-")
        if not mark:
            return self.atom()
        node = self.deeper(self.factor)
        if mark == "+":
            return node
        return Node("number", value=-node.value) if node.op == "number" else Node("neg", (node,))

    def deeper(self, part: Callable[[], Node]) -> Node:
        self.depth += 1
        if self.depth > MAX_BRACKET_DEPTH:
            raise self.fault(f"more than {MAX_BRACKET_DEPTH} brackets or signs within each other")
        node = part()
        self.depth -= 1
        return node

    def atom(self) -> Node:
        self.blank()
        self.count += 1
        if self.count > MAX_FORMULA_FACTORS:
            raise self.fault(f"more than {MAX_FORMULA_FACTORS} factors")
        if self.taken("("):
            return self.closed(self.deeper(self.sum))
        number = _NUMBER.match(self.text, self.at)
        named = self.column()
        if named:
            return Node("column", name=named)
        if number:
            self.at = number.end()
            return Node("number", value=float(number[0]))
        call = re.compile(r"(\w+)\s*\(").match(self.text, self.at)
        if call and call[1] in FUNCTIONS:
            self.at = call.end()
            return self.called(call[1])
        raise self.unknown()

    def closed(self, node: Node) -> Node:
        if not self.taken(")"):
            raise self.fault("a ) is missing")
        return node

    def called(self, name: str) -> Node:
        arguments = [self.deeper(self.sum)]
        while self.taken(","):
            arguments.append(self.deeper(self.sum))
        count = FUNCTIONS[name][0]
        if len(arguments) != count:
            raise self.fault(f"{name}() takes {count} value{'s' if count > 1 else ''}, not {len(arguments)}")
        if count > 1 and arguments[1].op != "number":
            raise self.fault(f"the second value of {name}() must be a number")
        return self.closed(Node(name, tuple(arguments)))

    def column(self) -> str:
        """Take the longest name of a column that comes next; its key, or "". A number is one, unless in quotes."""
        rest = self.text[self.at :]
        quoted = re.match(r"([\"'`])(.+?)\1", rest)
        if quoted:
            found = next((name for name in self.names if name.lower() == quoted[2].strip().lower()), None)
            if found is None:
                raise self.unknown(quoted[2])
            self.at += quoted.end()
            return self.names[found]
        for same in (True, False):
            for name, key in self.names.items():
                head, after = rest[: len(name)], rest[len(name) : len(name) + 1]
                whole = not (name[-1].isalnum() or name[-1] == "_") or not (
                    after.isalnum() or (after in ("_", ".") and after)
                )
                if (
                    name
                    and whole
                    and not _NUMBER.fullmatch(name)
                    and (head == name if same else head.lower() == name.lower())
                ):
                    self.at += len(name)
                    return key
        return ""

    def unknown(self, word: str = "") -> RecordError:
        from signlin_ros.records.table import listing, nearest

        match = _WORD.match(self.text, self.at)
        word = word or (match[0] if match else self.text[self.at : self.at + 10])
        if not word:
            return self.fault("it ends where a number or a column should be")
        labels = list(dict.fromkeys(self.names.values()))
        return self.fault(f"unknown: {word!r}; {listing(labels)}{nearest(word, labels)}")
