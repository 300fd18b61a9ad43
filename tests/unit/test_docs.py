"""What the documentation names of the code is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "decisions").glob("*.md")])
FILES = [p for folder in ("signlin_ros", "sim_nodes", "tests", "benchmarks", "docs", "config")
         for p in (ROOT / folder).rglob("*.py")]  # fmt: skip
EXAMPLES = {"effects/my_effect.py"}


def files(name: str) -> list[Path]:
    """The files that a name such as ``force/record.py`` or ``*_logic.py`` may mean."""
    return [p for p in FILES if p.match(name)]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_every_file_that_is_named_exists(page):
    named = set(re.findall(r"[\w*./]*\w\.py\b", page.read_text(encoding="utf-8"))) - EXAMPLES
    assert [name for name in sorted(named) if not files(name)] == []


def test_every_function_that_the_architecture_names_beside_its_file_is_there():
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    pairs = [(file, name) for file, names in re.findall(r"`([\w/]+\.py): ([\w., ]+)`", text)
             for name in names.split(", ")]  # fmt: skip
    assert len(pairs) > 10

    def there(file: str, name: str) -> bool:
        word = re.escape(name.rpartition(".")[2])
        defined = re.compile(rf"^\s*(?:(?:def|class) {word}\b|{word}\b.*=)", re.MULTILINE)
        return any(defined.search(p.read_text(encoding="utf-8")) for p in files(file))

    assert [pair for pair in pairs if not there(*pair)] == []
