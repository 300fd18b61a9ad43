"""Draw docs/images/architecture.png from the layers in pyproject.toml: what import-linter enforces is what is drawn.

    python docs/make_architecture.py

Every package and module of signlin_ros stands in its layer, with its number of lines; imports run downward only.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parent.parent
BANDS = {
    "ROS 2": ("sim_nodes", "demo", "nodes"),
    "what a user calls": (
        "cli",
        "workbench",
        "guard",
        "learning",
        "control",
        "report",
        "figures",
        "plotting",
        "console",
    ),
    "measurements and models": ("diagnosis", "fitting", "comparison", "predict", "checks", "warming", "records"),
    "models": ("linearize", "simulate", "model", "plants", "effects", "par", "sign"),
    "engine": ("follow", "compiled", "recording", "mathops", "engine"),
}
"""Names of colours in the picture, and modules that have each; others take the colour of the one before."""
COLOURS = ("#c6dbef", "#fdd0a2", "#c7e9c0", "#dadaeb", "#d9d9d9")


def layers() -> list[list[str]]:
    """Return the layers of the project from top to bottom, the modules of each."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        contracts = tomllib.load(file)["tool"]["importlinter"]["contracts"]
    found = next(c["layers"] for c in contracts if c["type"] == "layers")
    return [[name.strip(" ()") for name in layer.split("|")] for layer in found]


def lines(module: str) -> int:
    """Return the number of lines of a module, or of all modules of a package."""
    path = ROOT / module.replace(".", "/")
    files = path.rglob("*.py") if path.is_dir() else [path.with_suffix(".py")]
    return sum(len(f.read_text().splitlines()) for f in files)


def draw(target: Path) -> None:
    """Write the picture."""
    rows = layers()
    figure, axes = plt.subplots(figsize=(8, 0.34 * len(rows) + 0.6))
    kinds, kind = {m: i for i, (_, names) in enumerate(BANDS.items()) for m in names}, 0
    for k, names in enumerate(rows):
        for i, name in enumerate(names):
            width, short = 1.0 / len(names), name.removeprefix("signlin_ros.")
            kind = kinds.get(short, kind)
            box = plt.Rectangle((i * width, -k), width, -0.86, facecolor=COLOURS[kind], edgecolor="white")
            axes.add_patch(box)
            axes.text((i + 0.5) * width, -k - 0.43, f"{short}  {lines(name):,}", ha="center", va="center", fontsize=8)
    handles = [plt.Rectangle((0, 0), 1, 1, facecolor=c) for c in COLOURS]
    axes.legend(handles, BANDS, ncols=5, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False, fontsize=8)
    axes.set(xlim=(0, 1), ylim=(-len(rows), 0))
    axes.axis("off")
    figure.tight_layout()
    figure.savefig(target, dpi=150)


if __name__ == "__main__":
    draw(ROOT / "docs" / "images" / "architecture.png")
