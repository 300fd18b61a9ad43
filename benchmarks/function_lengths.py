"""List the functions that are longer than 30 lines with the reason that each gives.

    python benchmarks/function_lengths.py [--all]

A function's length is counted from its ``def`` to its last line, without its docstring. A reason stands in a comment
``# long: why`` on the line of the ``def``.
"""

from __future__ import annotations

import argparse
import ast
import re
import statistics
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("signlin_ros", "sim_nodes", "config", "demo", "benchmarks", "docs", "tests")
LIMIT = 30
Definition = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Function:
    """A function: file relative to the root, dotted name in it, first line, length, and the reason on its line."""

    file: str
    name: str
    line: int
    length: int
    reason: str

    @property
    def key(self) -> str:
        return f"{self.file}:{self.name}"


def functions(file: Path) -> Iterator[Function]:
    """Yield every function of a file, methods and inner functions too."""
    text = file.read_text(encoding="utf-8")
    lines = text.splitlines()
    stack: list[tuple[str, ast.AST]] = [("", ast.parse(text, str(file)))]
    while stack:
        prefix, node = stack.pop()
        for child in ast.iter_child_nodes(node):
            name = f"{prefix}{child.name}." if isinstance(child, Definition | ast.ClassDef) else prefix
            stack.append((name, child))
            if isinstance(child, Definition):
                signature = "\n".join(lines[child.lineno - 1 : child.body[0].lineno])
                found = re.search(r"#\s*long:\s*(.+)", signature)
                reason = found.group(1).strip() if found else ""
                yield Function(str(file.relative_to(ROOT)), name[:-1], child.lineno, _length(child), reason)


def _length(node: Definition) -> int:
    first, last = node.lineno, node.end_lineno or node.lineno
    doc = node.body[0] if ast.get_docstring(node, clean=False) is not None else None
    return last - first + 1 - ((doc.end_lineno or doc.lineno) - doc.lineno + 1 if doc else 0)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--all", action="store_true", help="list every function, longest first")
    everything = parser.parse_args().all
    files = [file for folder in FOLDERS for file in sorted((ROOT / folder).rglob("*.py"))]
    found = sorted((f for file in files for f in functions(file)), key=lambda f: -f.length)
    long = [f for f in found if f.length > LIMIT]
    for f in found if everything else long:
        print(f"{f.length:4d}  {f.file}:{f.line} {f.name}" + (f"  -- {f.reason}" if f.reason else ""))
    lengths = [f.length for f in found]
    short = 100 * sum(n <= LIMIT for n in lengths) / len(lengths)
    print(f"{len(found)} functions, median {statistics.median(lengths):g} lines, {short:.1f} % of at most {LIMIT}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
