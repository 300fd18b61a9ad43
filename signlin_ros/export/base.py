"""What a target is, what it writes, and what it says of a model."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from signlin_ros import __version__
from signlin_ros.errors import MissingExtraError, ModelError
from signlin_ros.export.functions import Constant, constants, parameters
from signlin_ros.model import Model

Array = NDArray[np.float64]


class NotRunError(Exception):
    """An exported file was not run; the message says why, in words for a table."""


@dataclass(frozen=True)
class ExportedDrive:
    """What a run is driven with: t (T,) s, u (T, m), from when each row acts (T,) s, and the state x0 (n,) at t[0]."""

    t: Array
    u: Array
    acts: Array
    x0: Array

    def input_at(self, times: Array) -> Array:
        """Return the inputs (K, m) at any times (K,): held from when they act."""
        k = np.searchsorted(self.acts, times + 1e-9 * np.ptp(self.t), side="right") - 1
        return self.u[np.clip(k, 0, len(self.u) - 1)]


@dataclass(frozen=True)
class Exported:
    """What was written: the files, what of the model they hold, what is lost, and settings that were measured."""

    files: tuple[Path, ...]
    holds: tuple[str, ...]
    lost: tuple[str, ...] = ()
    settings: Mapping[str, str] = field(default_factory=dict)


class Target:
    """A format or a language that a model is exported to: `write` makes the files, `run` drives them there.

    ``smooth``: the target has sign_j in place of sign.
    """

    name: ClassVar[str]
    suffix: ClassVar[str]
    engine: ClassVar[str]
    """What runs the file."""
    smooth: ClassVar[bool] = False

    def write(self, model: Model, out: Path, drive: ExportedDrive) -> Exported:
        """Write a model to ``out``; settings that have to be measured are, on ``drive``. Raises `ModelError`."""
        raise NotImplementedError

    def run(self, exported: Exported, model: Model, drive: ExportedDrive) -> dict[str, Array]:
        """Return the states (T,) by name as the target's own engine finds them.

        Raises `NotRunError` where there is no such engine.
        """
        raise NotImplementedError


def require(module: str, target: str) -> None:
    """Raise `MissingExtraError` where what runs a target is not installed."""
    import importlib.util

    if importlib.util.find_spec(module) is None:
        raise MissingExtraError(f"export --to {target} ({module})", "export")


def refuse_sensors(model: Model) -> tuple[str, ...]:
    """Return the losses of a model's sensors: a target holds true values."""
    from signlin_ros.model.uses import is_sensor

    names = [key for key, use in model.effects.items() if is_sensor(use)]
    return tuple(f"{name}: what a sensor shows; the file holds true values" for name in names)


def refuse_imposed(model: Model, target: str) -> None:
    """Raise `ModelError` for a plant without a motion of its own."""
    if model.plant.motion_is_imposed():
        raise ModelError(
            f"{model.source}: {target} needs a plant that moves; the motion of {model.plant.name} is imposed"
        )


def constant_note(constant: Constant) -> str:
    """Return the unit of a number, what it is, and how well it is known."""
    words = [constant.unit, constant.doc] if constant.unit else [constant.doc]
    if constant.std > 0.0:
        words.append(f"± {constant.std:.3g} (standard error of the fit)")
    elif constant.tolerance > 0.0 and constant.value:
        words.append(f"known to ±{100 * constant.tolerance:.3g} % (the model's tolerance)")
    return ", ".join(word for word in words if word)


def heading(model: Model, what: str) -> list[str]:
    """Return the lines of a comment that begins an exported file: model, equations, states, inputs, origin."""
    names = ", ".join(f"{n} [{model.units[n]}]" for n in model.states)
    inputs = ", ".join(f"{n} [{model.units[n]}]" for n in model.inputs)
    lines = [
        what,
        f"from {Path(model.source).name} by signlin_ros {__version__}",
        f"plant {model.plant.name}: {model.plant.equation}",
    ]
    for key, use in model.effects.items():
        from signlin_ros.model.uses import effect_class

        lines.append(f"effect {key}: {effect_class(use).equation}")
    lines += [f"states: {names}", f"inputs: {inputs}"]
    if model.delay:
        lines.append(f"input delay: {model.delay:g} s")
    return [part for line in lines for part in textwrap.wrap(line, 110, subsequent_indent="  ")]


def table_of_constants(model: Model) -> list[tuple[Constant, str]]:
    """Return every number of a model's equations with its note."""
    pars, surfaces = constants(model)
    return [(c, constant_note(c)) for c in (*pars, *surfaces)]


def table_of_parameters(model: Model) -> list[str]:
    """Return every parameter of a model as a line: name, value, unit, meaning, tolerance."""
    return [f"{c.public} = {c.value:.8g} {constant_note(c)}" for c in parameters(model)]


def ranges(model: Model) -> dict[str, tuple[float, float]]:
    """Return where a number may lie, two standard deviations either way, for those whose uncertainty is known.

    That is the standard error of a fit, else the tolerance that the model states; a positive number stays positive.
    """
    found = {}
    for c in parameters(model):
        spread = 2 * (c.std or abs(c.value) * c.tolerance)
        if spread > 0.0:
            low = c.value - spread
            found[c.public] = (max(low, 0.0) if c.value > 0 else low, c.value + spread)
    return found


__all__ = [
    "Array",
    "Exported",
    "ExportedDrive",
    "NotRunError",
    "Target",
    "constant_note",
    "heading",
    "ranges",
    "refuse_imposed",
    "refuse_sensors",
    "require",
    "table_of_constants",
    "table_of_parameters",
]
