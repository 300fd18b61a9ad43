"""The cells of a notebook, one after the other in this process: what they come to can be looked at."""

from __future__ import annotations

import ast
import json
import os
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "learn"
DATA = os.environ.get("SIGNLIN_DATA", "../shared/data")
"""Where records of others are, for the notebooks too."""
SHOWN_AS = ("__repr__", "_repr_html_", "_repr_png_", "_repr_svg_", "_repr_latex_")
"""How Jupyter asks the value of a cell to show itself."""


@cache
def cells_run(name: str) -> dict[str, Any]:
    """Run a notebook of docs/learn, and return what its cells have named; the value of each is asked to show itself."""
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    file = FOLDER / f"{name}.ipynb"
    space: dict[str, Any] = {"__name__": "notebook"}
    for cell in json.loads(file.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            lines = [line for line in "".join(cell["source"]).splitlines() if not line.startswith("%")]
            with mock.patch.dict(os.environ, {"SIGNLIN_DATA": DATA}):
                _run(ast.parse("\n".join(lines)), str(file), space)
            plt.close("all")
    return space


def _run(code: ast.Module, file: str, space: dict[str, Any]) -> None:
    last = code.body.pop() if code.body and isinstance(code.body[-1], ast.Expr) else None
    exec(compile(code, file, "exec"), space)
    if isinstance(last, ast.Expr):
        value = eval(compile(ast.Expression(last.value), file, "eval"), space)
        for way in SHOWN_AS:
            getattr(value, way, str)()
