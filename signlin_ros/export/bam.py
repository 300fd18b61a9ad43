"""BAM's JSON (models m1 to m5): a servo's motor and its friction, as BAM and Isaac Lab read it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

from signlin_ros import __version__
from signlin_ros.effects import find_effect, origin
from signlin_ros.errors import ModelError
from signlin_ros.export.bam_program import carried
from signlin_ros.export.base import Array, Exported, ExportedDrive, Target, ranges, refuse_sensors
from signlin_ros.model import Model
from signlin_ros.model.uses import is_sensor

Values = Mapping[str, float]
Put = Callable[[dict[str, float], Values], str]
KNOWN = ("xl330", "mx64", "mx106", "sts3215")
"""Actuators that BAM has a loop for, each shipped here as NAME_servo."""


def _coulomb(found: dict[str, float], p: Values) -> str:
    found["friction_base"] += p["mu"]
    return "friction_base"


def _viscous(found: dict[str, float], p: Values) -> str:
    found["friction_viscous"] += p["b"]
    return "friction_viscous"


def _stribeck(found: dict[str, float], p: Values) -> str:
    found["friction_base"] += p["mu"]
    found |= {"friction_stribeck": p["excess"], "dtheta_stribeck": p["v_s"], "alpha": 2.0}
    return "friction_base, friction_stribeck with alpha 2"


def _load(found: dict[str, float], p: Values) -> str:
    found |= {"load_friction_motor": p["kappa_d"], "load_friction_external": p["kappa_e"]}
    return "load_friction_motor, load_friction_external (where motor and load push alike, BAM has their difference)"


def _delay(found: dict[str, float], p: Values) -> str:
    found["command_delay"] = found.get("command_delay", 0.0) + p["T"]
    return "command_delay in s (Isaac Lab: min_delay and max_delay, in physics steps)"


def _load_stribeck(found: dict[str, float], p: Values) -> str:
    said = _load(found, p)
    found |= {
        "load_friction_motor_stribeck": p["kappa_d"] * p["excess"],
        "load_friction_external_stribeck": p["kappa_e"] * p["excess"],
        "dtheta_stribeck": p["v_s"],
        "alpha": 2.0,
    }
    return said


BAM_LAWS: dict[str, Put] = {
    "coulomb_friction": _coulomb,
    "viscous_friction": _viscous,
    "stribeck_friction": _stribeck,
    "load_dependent_friction": _load,
    "load_dependent_stribeck": _load_stribeck,
    "input_delay": _delay,
}
"""By effect of the catalogue: what puts it into the file and says where."""


def numbers_of(model: Model, target: str) -> tuple[dict[str, float], str, list[str], list[str]]:
    """Return the numbers of a BAM file, its model (m1, m2, m5), what it holds and what is lost.

    Raises `ModelError` for a plant that is no servo.
    """
    if model.plant.name != "servo":
        raise ModelError(f"{model.source}: --to {target} holds the plant servo; found {model.plant.name}")
    p = model.parameters
    found = {
        "kt": p["K_t"],
        "R": p["R"],
        "armature": p["J"],
        "q_offset": p["q0"],
        "friction_base": 0.0,
        "friction_viscous": 0.0,
    }
    holds, lost = ["servo: kt, R, armature, error_gain, max_pwm, kp, vin"], []
    for key, use in model.effects.items():
        if is_sensor(use):
            continue
        if origin(find_effect(use.type, "effects")) != "the catalogue":
            lost.append(f"{key}: a law of your own; BAM has its own laws only")
        elif use.type in BAM_LAWS:
            holds.append(f"{key}: {BAM_LAWS[use.type](found, use.parameters)}")
        else:
            lost.append(f"{key}: BAM has no term for it")
    name = "m1"
    if any(key.startswith("load_friction") for key in found):
        name = "m5"
        more = ("friction_stribeck", "load_friction_motor_stribeck", "load_friction_external_stribeck")
        found = {**dict.fromkeys(more, 0.0), "dtheta_stribeck": 1.0, "alpha": 1.0, **found}
    elif "friction_stribeck" in found:
        name = "m2"
    lost += _of_the_loop(model)
    return found, name, holds, [*lost, *refuse_sensors(model)]


def _of_the_loop(model: Model) -> list[str]:
    """Return the parts of the firmware's loop and of the inputs that BAM cannot hold."""
    p = model.parameters
    known = {"ki": "an integral gain", "kd": "a derivative gain", "sag": "the supply's sag", "profile_time": "a filter"}
    lost = [f"{name}: BAM's loop has no {what.split(' ', 1)[1]}" for name, what in known.items() if p[name]]
    inputs = [n for n in ("torque_enable", "supply", "goal_velocity") if n in model.inputs]
    return lost + [f"input {name}: the file has the model's own value throughout" for name in inputs]


def loop_of(model: Model) -> dict[str, float]:
    """Return the numbers of the firmware's loop, which BAM has in its code and Isaac Lab in its file."""
    p = model.parameters
    found = {"error_gain": p["duty_per_error"], "max_pwm": p["duty_limit"], "kp": p["kp"], "vin": p["vin"]}
    return {**found, "max_current": p["current_limit"]} if p["current_limit"] else found


def bench_of(model: Model) -> dict[str, float]:
    """Return the load of a servo: mass, length, arm_mass, inertia."""
    return {name: model.parameters[name] for name in ("mass", "length", "arm_mass", "inertia")}


def _actuator(model: Model) -> str:
    """Return the servo's name in BAM: by the model's file, else by the gain of its loop."""
    named = [k for k in KNOWN if k in Path(model.source).stem.lower()]
    own = model.parameters["duty_per_error"]
    alike = [k for k in KNOWN if abs(Model.load(f"{k}_servo").parameters["duty_per_error"] / own - 1) < 1e-3]
    return next(iter(named or (alike if len(alike) == 1 else [])), "custom")


class Bam(Target):
    """A BAM file; run by a program of BAM's published equations, as BAM itself is on no package registry."""

    name, suffix, engine = "bam", ".json", "a program of BAM's published equations"

    def write(self, model: Model, out: Path, drive: ExportedDrive) -> Exported:
        """Write the file."""
        numbers, name, holds, lost = numbers_of(model, self.name)
        actuator = _actuator(model)
        if actuator == "custom":
            lost.append("actuator: which of BAM's loops it is; set its name")
        units = {c: par.unit for c, par in model.plant.pars().items()}
        said = {
            "from": f"{Path(model.source).name}, signlin_ros {__version__}",
            "units": {"kt": units["K_t"], "R": units["R"], "armature": units["J"], "friction": "N·m, N·m·s/rad"},
            "bench": bench_of(model),
            "ranges": {k: list(v) for k, v in ranges(model).items()},
        }
        content = {"model": name, "actuator": actuator, **numbers, **loop_of(model), "_about": said}
        out.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
        return Exported((out,), tuple(holds), tuple(lost), {"model": name, "actuator": actuator})

    def run(self, exported: Exported, model: Model, drive: ExportedDrive) -> dict[str, Array]:
        """Run the file's numbers with `bam_program`."""
        numbers = json.loads(exported.files[0].read_text(encoding="utf-8"))
        late = ExportedDrive(drive.t, drive.u, drive.acts + model.delay, drive.x0)
        position, speed = carried(numbers, late, numbers["_about"]["bench"])
        return {"position": position, "speed": speed}


TARGET = Bam()

__all__ = ["TARGET", "Bam", "bench_of", "loop_of", "numbers_of"]
