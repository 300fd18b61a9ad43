"""What a controller of another model has to compile is compiled in another process."""

from __future__ import annotations

import os
from pathlib import Path

from signlin_ros.control.controller import Controller, ControllerSettings
from signlin_ros.model import Model
from signlin_ros.nodes.apart import MadeApart

SETTINGS = ControllerSettings(limit=12.0, speed=5.0)
EFFECT = """
import os, pathlib
from signlin_ros.effects.base import Effect
from signlin_ros.par import Par

with (pathlib.Path(__file__).parent / "read").open("a") as file:
    file.write(f"{os.getpid()}\\n")


class OwnDrag(Effect):
    \"\"\"-b v.\"\"\"

    name = "own_drag"
    equation = "-b v"
    b = Par("F·s/Q", nominal=0.001, doc="drag")

    def force(self, m, x, p):
        return -p.b * x.velocity
"""


def test_another_process_makes_the_controller(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(EFFECT)
    (tmp_path / "model.yaml").write_text(
        "/**: {ros__parameters: {plant: dc_motor, effects: {own_drag: {b: 0.0005}}, effect_files: [own.py],\n"
        "parameters: {R_a: 0.764, L_a: 0.0026, K_t: 0.0805, K_m: 0.0805, B: 0.0, J: 0.0022}}}\n"
    )
    model = Model.load(tmp_path / "model.yaml")
    assert MadeApart(model, SETTINGS).wait()
    readers = {int(line) for line in (tmp_path / "read").read_text().split()}
    assert os.getpid() in readers
    assert len(readers) == 2
    Controller(model, SETTINGS)


def test_what_cannot_be_made_is_no_fault_there() -> None:
    assert not MadeApart(Model.load("force_element"), SETTINGS).wait()


def test_it_can_be_stopped() -> None:
    apart = MadeApart(Model.load("dc_motor"), SETTINGS)
    apart.stop()
    assert not apart.wait()
