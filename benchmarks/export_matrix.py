"""What every target loses of every effect, run there: python -m benchmarks.export_matrix [-o docs/reference/export.md].

The tables stand in docs/reference/export.md between the lines <!-- matrix --> and <!-- end of matrix -->.
"""

import argparse
import re
import sys
from pathlib import Path

from signlin_ros.export.matrix import Cell, matrix, servo_bench, table

MOTOR = ("mjcf", "c", "fmu", "python-control", "casadi", "do-mpc", "sympy", "urdf", "sdf")
SERVO = ("mjcf", "bam", "isaaclab", "c", "urdf")


def reasons(cells: list[Cell]) -> list[str]:
    """Why a cell holds no number, and what is lost of each effect; each said once."""
    found: dict[str, list[str]] = {}
    for cell in cells:
        if cell.percent is None and cell.why:
            found.setdefault(f"{cell.word}: {cell.why}", []).append(
                cell.target if cell.word == "not run" else cell.effect
            )
        for line in cell.lost if cell.target in ("mjcf", "bam", "isaaclab", "urdf") else ():
            if line.startswith(f"{cell.effect}: "):
                found.setdefault(f"{cell.target}, lost: {line.split(': ', 1)[1]}", []).append(cell.effect)
    lines = []
    for why, where in found.items():
        lines.append(f"- {why} ({', '.join(f'`{name}`' for name in dict.fromkeys(where))})")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--targets", nargs="*")
    parser.add_argument("--effects", nargs="*", default=())
    given = parser.parse_args()
    parts = []
    for title, targets, base in (
        ("On the paper's motor, without its friction", MOTOR, None),
        ("On the XL-330 servo, without its friction", SERVO, servo_bench()),
    ):
        cells = []
        for cell in matrix([t for t in targets if t in (given.targets or targets)], given.effects, base):
            cells.append(cell)
            print(f"{cell.effect:28} {cell.target:15} {cell.text}", file=sys.stderr, flush=True)
        parts += [f"### {title}", "", *table(cells), "", *reasons(cells), ""]
    text = "\n".join(parts)
    if given.output:
        page = given.output.read_text(encoding="utf-8")
        inner = f"<!-- matrix -->\n\n{text}\n<!-- end of matrix -->"
        given.output.write_text(re.sub(r"<!-- matrix -->.*<!-- end of matrix -->", lambda _: inner, page, flags=re.S))
    else:
        print(text)


if __name__ == "__main__":
    main()
