"""What the documentation names of the code is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "decisions").glob("*.md")])
FILES = [p for folder in ("signlin_ros", "sim_nodes", "tests", "benchmarks", "docs", "config")
         for p in (ROOT / folder).rglob("*.py")]  # fmt: skip
EXAMPLES = {"effects/my_effect.py", "export/my_target.py"}


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


def links(page: Path) -> list[str]:
    """The relative links of a page, without anchors."""
    found = re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8"))
    return [link.partition("#")[0] for link in found if "://" not in link and not link.startswith("#")]


@pytest.mark.parametrize("page", [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))],
                         ids=lambda p: p.stem)  # fmt: skip
def test_every_internal_link_leads_somewhere(page):
    assert [link for link in links(page) if not (page.parent / link).exists()] == []


def test_every_page_is_in_the_navigation():
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    pages = [
        p for kind in ("*.md", "*.ipynb") for p in (ROOT / "docs").rglob(kind) if ".ipynb_checkpoints" not in p.parts
    ]
    names = [str(p.relative_to(ROOT / "docs")) for p in pages]
    assert [name for name in sorted(names) if not re.search(rf"(?:: |- ){re.escape(name)}$", text, re.MULTILINE)] == []


def test_the_results_page_is_what_its_tables_say():
    import importlib.util

    spec = importlib.util.spec_from_file_location("make_results", ROOT / "docs" / "make_results.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert (ROOT / "docs" / "results.md").read_text(encoding="utf-8") == module.page()
