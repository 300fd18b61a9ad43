"""Every number that decides stands in `Criteria`: none is a literal in a comparison elsewhere."""

from __future__ import annotations

import ast
from dataclasses import fields
from pathlib import Path

import signlin_ros
from benchmarks.ablation import OFF
from signlin_ros.diagnosis.criteria import Criteria

ROOT = Path(signlin_ros.__file__).parent
ROOMS = ("comparison", "fitting", "diagnosis")
ALLOWED = {0, 1, 2, -1, 0.5, 100.0}
"""What a comparison may hold: nothing, a unit, a sign, a pair, a half, and per cent."""
MOST = 60


def modules() -> list[Path]:
    return [p for room in ROOMS for p in sorted((ROOT / room).rglob("*.py"))]


def numbers(node: ast.AST) -> list[float]:
    """Return the numbers in an expression that a value is compared with: not those of indices."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub) and isinstance(node.operand, ast.Constant):
        return [-v for v in numbers(node.operand)]
    if isinstance(node, ast.Constant):
        plain = isinstance(node.value, (int, float)) and not isinstance(node.value, bool)
        return [node.value] if plain else []
    if isinstance(node, ast.Subscript):
        return numbers(node.value)
    return [v for child in ast.iter_child_nodes(node) for v in numbers(child)]


def tiny(value: float) -> bool:
    """Tell whether a number only keeps a division from failing."""
    return 0 < abs(value) <= 1e-9


def literals(source: str) -> list[tuple[int, float]]:
    """Return line and value of every number in a comparison that is not allowed there."""
    compared = [n for n in ast.walk(ast.parse(source)) if isinstance(n, ast.Compare)]
    return [(n.lineno, v) for n in compared for v in numbers(n) if v not in ALLOWED and not tiny(v)]


def constants(source: str) -> dict[str, bool]:
    """Return the module's named numbers, and whether a docstring says what each is: one may serve several in a row."""
    body, found = ast.parse(source).body, {}
    for k, node in enumerate(body):
        if not (isinstance(node, ast.Assign) and any(numbers(node.value))):
            continue
        names = [n.id for t in node.targets for n in ast.walk(t) if isinstance(n, ast.Name) and n.id.isupper()]
        after = next((n for n in body[k + 1 :] if not isinstance(n, ast.Assign)), None)
        told = (
            isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) and isinstance(after.value.value, str)
        )
        found |= dict.fromkeys(names, told)
    return found


def test_the_search_for_literals_finds_them():
    found = literals("def f(x, y):\n    return x > 3.5 and y[7] < -0.2 * x or x < 1 + 1e-12")
    assert found == [(2, 3.5), (2, -0.2)]
    assert constants('A = 3\n"""Said."""\nB = 4\nc = 5\n') == {"A": True, "B": False}


def test_no_number_decides_that_is_not_named():
    found = {str(p.relative_to(ROOT)): literals(p.read_text(encoding="utf-8")) for p in modules()}
    assert {name: where for name, where in found.items() if where} == {}


def test_named_numbers_say_what_they_are():
    found = {str(p.relative_to(ROOT)): constants(p.read_text(encoding="utf-8")) for p in modules()}
    print(f"criteria: {len(fields(Criteria))}; named numbers beside them: {sum(map(len, found.values()))}")
    assert {(name, n) for name, all_ in found.items() for n, told in all_.items() if not told} == set()


def test_every_criterion_can_be_switched_off():
    assert {f.name for f in fields(Criteria)} == set(OFF)


def test_criteria_are_few_and_each_says_what_it_means():
    body = ast.parse((ROOT / "diagnosis" / "criteria.py").read_text(encoding="utf-8")).body
    (cls,) = [n for n in body if isinstance(n, ast.ClassDef)]
    after = [(a, b) for a, b in zip(cls.body, [*cls.body[1:], None], strict=True) if isinstance(a, ast.AnnAssign)]
    assert len(after) == len(fields(Criteria)) <= MOST
    assert all(isinstance(b, ast.Expr) and isinstance(b.value, ast.Constant) for _, b in after)
