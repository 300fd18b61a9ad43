"""Draw docs/images/method.png: from a record to a verdict.

python docs/make_method.py
"""

from __future__ import annotations

from pathlib import Path

from signlin_ros.plotting import canvas

BOXES = {  # name: (x, y, width, text)
    "record": (0.0, 2.0, 1.5, "record, model"),
    "check": (2.0, 2.0, 1.5, "check, cure,\nsegments"),
    "base": (4.0, 2.0, 1.6, "base model,\nrefitted (priors)"),
    "equation": (6.2, 3.0, 1.9, "equation error:\nlaws as regressors\nof the force residual"),
    "output": (6.2, 1.0, 1.9, "output error:\nsimulation with\nset-valued friction"),
    "select": (8.7, 2.0, 1.5, "selection:\nfewest effects,\nties"),
    "residual": (10.8, 2.0, 1.5, "residual:\nwhite? seen?\nstructure?"),
}
ARROWS = ["record check", "check base", "base equation", "base output", "equation output", "equation select",
          "output select", "select residual"]  # fmt: skip
VERDICTS = {3.0: "adequate", 2.0: "missing: NAME\n(what is left, in %)", 1.0: "unexplained:\nwhy, what to record"}


def main() -> None:
    """Draw the picture."""
    path = Path(__file__).resolve().parent / "images" / "method.png"
    with canvas(path, 11.0, 2.9) as figure:
        axes = figure.add_subplot()
        axes.set(xlim=(-0.1, 15.0), ylim=(0.3, 4.0))
        axes.axis("off")
        for x, y, width, text in BOXES.values():
            _box(axes, x, y, width, text, "#E8F1FA")
        for y, text in VERDICTS.items():
            _box(axes, 13.0, y, 1.9, text, "#FDF3E0")
            _arrow(axes, (12.3, 2.0), (13.0, y))
        for arrow in ARROWS:
            start, end = (BOXES[name] for name in arrow.split())
            vertical = start[0] == end[0]
            tail = (start[0] + start[2] / 2, start[1] - 0.42) if vertical else (start[0] + start[2], start[1])
            head = (end[0] + end[2] / 2, end[1] + 0.42) if vertical else (end[0], end[1])
            _arrow(axes, tail, head)
        axes.text(7.15, 3.75, "training data fit, validation data decide", ha="center", fontsize=8, style="italic")


def _box(axes: object, x: float, y: float, width: float, text: str, colour: str) -> None:
    style = {"boxstyle": "round,pad=0.3", "fc": colour, "ec": "#555555", "lw": 0.8}
    axes.text(x + width / 2, y, text, ha="center", va="center", fontsize=8, bbox=style)  # type: ignore[attr-defined]


def _arrow(axes: object, tail: tuple[float, float], head: tuple[float, float]) -> None:
    axes.annotate("", head, tail, arrowprops={"arrowstyle": "->", "color": "#555555", "lw": 1.0})  # type: ignore[attr-defined]


if __name__ == "__main__":
    main()
