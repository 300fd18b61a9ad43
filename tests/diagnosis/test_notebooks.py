"""The notebooks that diagnose: every cell runs. What measured machines come to in them is looked at in
test_real_machines and test_shared_records.
"""

from __future__ import annotations

import pytest

from tests.notebooks import cells_run


@pytest.mark.xdist_group("motor_notebook")
def test_motor():
    space = cells_run("motor")
    assert set(space["refined"].effects) == {"coulomb_friction", "constant_load"}


@pytest.mark.xdist_group("shared_records")
def test_damper():
    space = cells_run("damper")
    assert set(space["found"].model.effects) == {"dahl_presliding"}
