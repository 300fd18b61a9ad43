"""Effects times targets: what each target loses of each effect, run there."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from signlin_ros.effects import CATALOGUE, EFFECTS, SensorEffect
from signlin_ros.errors import InputError
from signlin_ros.export import TARGETS, export, find_target
from signlin_ros.export.excitation import standard_excitation
from signlin_ros.export.functions import without
from signlin_ros.export.loss import reference
from signlin_ros.model import Model

EFFECT_SIZES: dict[str, dict[str, Any]] = {
    "viscous_friction": {"b": 0.005},
    "coulomb_friction": {"mu": 0.033},
    "stribeck_friction": {"mu": 0.03, "excess": 0.02, "v_s": 1.0},
    "asymmetric_viscous_friction": {"b_p": 0.004, "b_n": 0.008},
    "power_law_friction": {"c": 0.01, "a": 0.6},
    "quadratic_drag": {"c2": 0.0008},
    "cubic_viscous_friction": {"b": 0.002, "b3": 0.0001},
    "load_dependent_friction": {"kappa_d": 0.2, "kappa_e": 0.1},
    "constant_load": {"F0": 0.03},
    "gravity_load": {"A": 0.1, "q0": 0.3},
    "cogging_torque": {"A": 0.02, "N": 7.0, "phi": 0.4},
    "torque_ripple": {"orders": [3.0, 7.0], "A": [0.02, 0.01], "phi": [0.1, 0.8]},
    "linear_stiffness": {"k": 0.1},
    "cubic_stiffness": {"k3": 0.05},
    "asymmetric_stiffness": {"k2": 0.02, "k3": 0.05},
    "hard_stop": {"gap": 0.3, "k_s": 2.0},
    "dahl_presliding": {"F_c": 0.033, "sigma": 2.0},
    "lugre_friction": {"sigma0": 20.0, "sigma1": 0.02, "sigma2": 0.001, "F_c": 0.03, "F_s": 0.05, "v_s": 1.0},
    "play_friction": {"F_c": 0.03, "sigma": 2.0, "gap": 0.02},
    "compliant_load": {"k": 5.0, "c": 0.01, "J": 0.001},
    "backlash": {"k": 20.0, "c": 0.05, "J": 0.001, "gap": 0.02},
    "input_offset": {"u0": 0.3},
    "input_deadzone": {"d": 0.3},
    "input_saturation": {"u_max": 1.0},
    "input_delay": {"T": 0.013},
    "torque_constant_saturation": {"kappa": 0.05},
    "thermal_resistance": {"a": 0.0039, "C": 0.02, "R_th": 20.0},
}
"""Values at which an effect is of some size on the paper's motor; nominal ones for the rest."""
OWN = 0.1
"""Range of an effect's own states, where the plant's ranges say how large surfaces are."""
DROPPED = "dropped"
NOT_A_MODEL_ALONE = ("learned_force", "temperature_dependent_friction")
"""Effects that need a record: a curve of its own, a temperature."""


@dataclass(frozen=True)
class Cell:
    """One effect in one target: percent of the speed's RMS that the run is off, or a word and why."""

    effect: str
    target: str
    percent: float | None
    word: str = ""
    why: str = ""
    holds: tuple[str, ...] = ()
    lost: tuple[str, ...] = ()
    settings: tuple[tuple[str, str], ...] = ()

    @property
    def text(self) -> str:
        """The cell as it stands in a table."""
        if self.percent is None:
            return self.word
        return f"{self.percent:.0f}" if self.percent >= 10 else f"{self.percent:.2g}"


def bench() -> Model:
    """Return the paper's motor without friction, with its position: what each effect is added to."""
    return Model.load("dc_motor").without_effect("coulomb_friction").with_options(with_position=True)


def servo_bench() -> Model:
    """Return the XL-330 servo on its arm without friction, torque on and supply constant."""
    servo = Model.load("xl330_servo")
    bare = servo.without_effect(*servo.effects)
    used = {name: value for name, value in bare.operating_range.items() if name != "supply"}
    return bare.with_options(with_inputs=(), operating_range=used, signals={})


def models(base: Model | None = None) -> Iterator[tuple[str, Model | str]]:
    """Yield every effect of the catalogue on a plant that takes it, or why it is left out."""
    base = bench() if base is None else base
    yield "(none)", base
    for name in CATALOGUE:
        if name not in EFFECTS or issubclass(EFFECTS[name], SensorEffect):
            continue
        if name in NOT_A_MODEL_ALONE:
            yield name, "needs a record of its own"
            continue
        try:
            found = base.with_effect(name, **EFFECT_SIZES.get(name, {}))
            own = {state: OWN for state in found.states if "." in state}
            if base.operating_range:
                found = found.with_options(operating_range={**own, **base.operating_range})
        except InputError as error:
            yield name, str(error).replace(f"{base.source}: ", "")
        else:
            yield name, found


def cell(name: str, model: Model, target: str, folder: Path) -> Cell:
    """Export one model to one target, run it there."""
    out = folder / f"model{find_target(target).suffix}"
    try:
        done = export(model, target, out)
    except InputError as error:
        return Cell(name, target, None, "refused", str(error).replace(f"{model.source}: ", "")[:200])
    if done.loss.not_run:
        return Cell(name, target, None, "not run", done.loss.not_run, done.exported.holds, done.exported.lost)
    channel = done.loss.channels.get(model.plant.velocity)
    if channel is None:
        return Cell(name, target, None, "diverges", "", done.exported.holds, done.exported.lost)
    settings = tuple(done.exported.settings.items())
    return Cell(name, target, channel.percent, "", "", done.exported.holds, done.exported.lost, settings)


def dropped(model: Model, name: str) -> Cell:
    """Return the loss of a target that leaves an effect out, in per cent: the column "dropped"."""
    if name not in model.effects:
        return Cell(name, DROPPED, 0.0)
    drive, bare = standard_excitation(model), without(model, name)
    start = dict(zip(model.states, drive.x0, strict=True))
    try:
        other = reference(bare, replace(drive, x0=np.array([start[n] for n in bare.states])))
    except InputError as error:
        return Cell(name, DROPPED, None, "-", str(error))
    speed = reference(model, drive)[model.plant.velocity]
    off = other[model.plant.velocity] - speed
    return Cell(name, DROPPED, 100 * float(np.sqrt(np.mean(off**2) / np.mean(speed**2))))


def matrix(
    targets: Sequence[str] = tuple(TARGETS), effects: Sequence[str] = (), base: Model | None = None
) -> Iterator[Cell]:
    """Yield every cell, effect by effect."""
    with tempfile.TemporaryDirectory() as folder:
        for name, model in models(base):
            if effects and name not in effects:
                continue
            if not isinstance(model, str):
                yield dropped(model, name)
            for target in targets:
                if isinstance(model, str):
                    yield Cell(name, target, None, "left out", model)
                else:
                    yield cell(name, model, target, Path(folder))


def table(cells: Sequence[Cell]) -> list[str]:
    """Return a table in Markdown: a row for each effect, a column for each target."""
    targets = list(dict.fromkeys(c.target for c in cells))
    rows: dict[str, dict[str, Cell]] = {}
    for c in cells:
        rows.setdefault(c.effect, {})[c.target] = c
    lines = ["| effect | " + " | ".join(targets) + " |", "|---|" + "---:|" * len(targets)]
    for name, row in rows.items():
        texts = [row[t].text if t in row else "" for t in targets]
        lines.append(f"| `{name}` | {' | '.join(texts)} |")
    return lines


__all__ = ["Cell", "bench", "cell", "dropped", "matrix", "models", "servo_bench", "table"]
