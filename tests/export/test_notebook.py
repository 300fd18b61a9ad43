"""The notebook that ends in a running MuJoCo model: its cells, one after the other."""

import json
from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).resolve().parents[2] / "docs" / "learn" / "simulator.ipynb"


@pytest.mark.slow
def test_notebook_ends_in_a_running_model(monkeypatch, capsys):
    mujoco = pytest.importorskip("mujoco")
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    space: dict[str, object] = {"__name__": "notebook"}
    for cell in cells:
        if cell["cell_type"] == "code":
            lines = [line for line in "".join(cell["source"]).splitlines() if not line.startswith("%")]
            exec(compile("\n".join(lines), str(NOTEBOOK), "exec"), space)
    model, data = space["model"], space["data"]
    assert isinstance(model, mujoco.MjModel)
    assert data.time == pytest.approx(space["t"][-1], abs=2 * model.opt.timestep)
    assert "deg RMS" in capsys.readouterr().out
    space["plt"].close("all")
    assert space["error"] < 2.0  # degrees
