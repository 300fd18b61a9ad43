"""The notebook that ends in a running MuJoCo model."""

import pytest

from tests.notebooks import cells_run


@pytest.mark.slow
def test_notebook_ends_in_a_running_model(capsys):
    mujoco = pytest.importorskip("mujoco")
    space = cells_run("simulator")
    model, data = space["model"], space["data"]
    assert isinstance(model, mujoco.MjModel)
    assert data.time == pytest.approx(space["t"][-1], abs=2 * model.opt.timestep)
    assert "deg RMS" in capsys.readouterr().out
    assert space["error"] < 2.0  # degrees
