"""How large the project is, against the limits it has set itself; exit 1 if one does not hold.

    python benchmarks/size.py

Lines of every package, modules of more than 400 lines, the number of criteria that decide in a diagnosis.
"""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

from signlin_ros.diagnosis.criteria import Criteria

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("signlin_ros", "sim_nodes")
ROOMS = ("comparison", "fitting", "diagnosis")
DIAGNOSIS, PACKAGE, MODULE, CRITERIA = 8000, 3500, 400, 60
"""Most lines of comparison, fitting and diagnosis together, of any package, of a module; most criteria."""


def lines(path: Path) -> int:
    """Return the number of lines of a file."""
    return len(path.read_text().splitlines())


def sizes() -> dict[str, int]:
    """Return the lines of every package: of the modules in its own folder."""
    folders = {f.parent for p in PACKAGES for f in (ROOT / p).rglob("*.py")}
    own = {folder: sum(lines(f) for f in folder.glob("*.py")) for folder in folders}
    return {str(f.relative_to(ROOT)): n for f, n in sorted(own.items(), key=lambda item: -item[1])}


def long_modules() -> dict[str, int]:
    """Return the modules that are longer than a module should be."""
    files = (f for p in PACKAGES for f in (ROOT / p).rglob("*.py"))
    found = {str(f.relative_to(ROOT)): lines(f) for f in files}
    return {n: k for n, k in sorted(found.items(), key=lambda item: -item[1]) if k > MODULE}


def main() -> int:
    """Print all of it."""
    packages, modules, criteria = sizes(), long_modules(), len(dataclasses.fields(Criteria))
    whole = sum(n for name, n in packages.items() if name.split("/")[1:2] and name.split("/")[1] in ROOMS)
    print("lines by package")
    for name, n in packages.items():
        print(f"  {name:34}{n:7,}{'  over ' + format(PACKAGE, ',') if n > PACKAGE else ''}")
    print(f"\nmodules of more than {MODULE} lines: {len(modules)}")
    for name, n in modules.items():
        print(f"  {name:44}{n:5}")
    print(f"\ndiagnosis, comparison and fitting: {whole:,} lines (at most {DIAGNOSIS:,})")
    print(f"criteria of a diagnosis: {criteria} (at most {CRITERIA})")
    return int(whole > DIAGNOSIS or criteria > CRITERIA or any(n > PACKAGE for n in packages.values()))


if __name__ == "__main__":
    sys.exit(main())
