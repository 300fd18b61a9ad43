"""The catalogue of physical effects: one file each, one line each in the list below.

A user's own effect is a Python file named in a model's ``effect_files``, or an entry point in the group
``signlin_ros.effects``; `register` adds it.
"""

from __future__ import annotations

import functools
import importlib.metadata
import importlib.util
import inspect
from collections import Counter
from pathlib import Path

from signlin_ros.effects.asymmetric_viscous_friction import AsymmetricViscousFriction
from signlin_ros.effects.backlash import Backlash
from signlin_ros.effects.base import Effect, SensorEffect
from signlin_ros.effects.bouc_wen_hysteresis import BoucWenHysteresis
from signlin_ros.effects.cogging_torque import CoggingTorque
from signlin_ros.effects.compliant_load import CompliantLoad
from signlin_ros.effects.constant_load import ConstantLoad
from signlin_ros.effects.coulomb_friction import CoulombFriction
from signlin_ros.effects.cubic_stiffness import CubicStiffness
from signlin_ros.effects.cubic_viscous_friction import CubicViscousFriction
from signlin_ros.effects.dahl_presliding import DahlPresliding
from signlin_ros.effects.declared import check_declared
from signlin_ros.effects.gravity_load import GravityLoad
from signlin_ros.effects.hard_stop import HardStop
from signlin_ros.effects.input_deadzone import InputDeadzone
from signlin_ros.effects.input_delay import InputDelay
from signlin_ros.effects.input_saturation import InputSaturation
from signlin_ros.effects.learned_force import LearnedForce
from signlin_ros.effects.linear_stiffness import LinearStiffness
from signlin_ros.effects.load_dependent_friction import LoadDependentFriction
from signlin_ros.effects.load_dependent_stribeck import LoadDependentStribeck
from signlin_ros.effects.lugre_friction import LuGreFriction
from signlin_ros.effects.pinching_hysteresis import PinchingHysteresis
from signlin_ros.effects.play_friction import PlayFriction
from signlin_ros.effects.quadratic_drag import QuadraticDrag
from signlin_ros.effects.sensor_delay import SensorDelay
from signlin_ros.effects.sensor_gain import SensorGain
from signlin_ros.effects.sensor_offset import SensorOffset
from signlin_ros.effects.stribeck_friction import StribeckFriction
from signlin_ros.effects.temperature_dependent_friction import TemperatureDependentFriction
from signlin_ros.effects.thermal_resistance import ThermalResistance
from signlin_ros.effects.torque_constant_saturation import TorqueConstantSaturation
from signlin_ros.effects.torque_ripple import TorqueRipple
from signlin_ros.effects.viscous_friction import ViscousFriction
from signlin_ros.errors import ModelError, choices, suggest

EFFECTS: dict[str, type[Effect]] = {}
"""Every known effect by its name in model files."""
_ORIGINS: dict[type[Effect], str] = {}
"""The file or entry point that an effect comes from."""


def register(effect: type[Effect]) -> type[Effect]:
    """Add an effect to the catalogue; usable as a class decorator. Registering a name anew replaces it."""
    EFFECTS[effect.name] = effect
    return effect


for _effect in (
    ViscousFriction,
    CoulombFriction,
    StribeckFriction,
    AsymmetricViscousFriction,
    CubicViscousFriction,
    QuadraticDrag,
    LoadDependentFriction,
    LoadDependentStribeck,
    TemperatureDependentFriction,
    ConstantLoad,
    GravityLoad,
    CoggingTorque,
    TorqueRipple,
    LinearStiffness,
    CubicStiffness,
    HardStop,
    DahlPresliding,
    PlayFriction,
    LuGreFriction,
    BoucWenHysteresis,
    PinchingHysteresis,
    CompliantLoad,
    Backlash,
    LearnedForce,
    InputDeadzone,
    InputSaturation,
    InputDelay,
    TorqueConstantSaturation,
    ThermalResistance,
    SensorOffset,
    SensorGain,
    SensorDelay,
):
    register(_effect)


def load_entry_points() -> None:
    """Register the effects that installed packages offer in the group ``signlin_ros.effects``."""
    for entry in importlib.metadata.entry_points(group="signlin_ros.effects"):
        where = f"entry point {entry.name} = {entry.value}"
        _register_from(where, _checked(_loaded(entry), where))


def _register_from(where: str, effect: type[Effect]) -> None:
    """Register what a file or package offers; raise `ModelError` where another one has that name."""
    known = EFFECTS.get(effect.name, effect)
    if known is not effect and origin(known) != where:
        raise ModelError(f"{where}: {origin(known)} has an effect {effect.name!r} already; give this one another name")
    _ORIGINS[effect] = where
    register(effect)


def origin(effect: type[Effect]) -> str:
    """Return where an effect comes from, for messages."""
    built_in = effect.__module__.startswith(f"{__name__}.")
    return _ORIGINS.get(effect, "the catalogue" if built_in else effect.__module__)


def _loaded(entry: importlib.metadata.EntryPoint) -> object:
    try:
        return entry.load()
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        raise ModelError(f"entry point {entry.name} = {entry.value} fails: {what}") from error


def _checked(found: object, where: str) -> type[Effect]:
    """Return what was found, if it is an effect with a name and an equation."""
    if not (inspect.isclass(found) and issubclass(found, Effect)):
        raise ModelError(f"{where}: is no subclass of signlin_ros.effects.Effect")
    missing = [name for name in ("name", "equation") if not isinstance(getattr(found, name, None), str)]
    if missing:
        raise ModelError(f"{where}: class {found.__name__} lacks {' and '.join(missing)}")
    if issubclass(found, SensorEffect) and len(found.pars()) != 1:
        raise ModelError(f"{where}: class {found.__name__} has {len(found.pars())} parameters; a SensorEffect has one")
    check_declared(found, where)
    return found


def find_effect(name: str, where: str) -> type[Effect]:
    """Return the effect called ``name``, from an entry point if need be; raise `ModelError` otherwise."""
    if name not in EFFECTS:
        load_entry_points()
    if name not in EFFECTS:
        raise ModelError(f"{where}: unknown effect {name!r}; known: {choices(EFFECTS)}{suggest(name, EFFECTS)}")
    return EFFECTS[name]


def load_effect_file(path: Path) -> None:
    """Run a user's Python file and register every `Effect` in it; raise `ModelError` if it fails."""
    if not path.is_file():
        raise ModelError(f"effect_files: {path} {'is a folder' if path.is_dir() else 'does not exist'}")
    where = f"effect file {path.resolve()}"
    found = _effects_in(path, path.stat().st_mtime_ns)
    for name, count in Counter(effect.name for effect in found).items():
        if count > 1:
            raise ModelError(f"{where}: two effects are called {name!r}")
    for effect in found:
        _register_from(where, effect)


@functools.cache
def _effects_in(path: Path, changed: int) -> tuple[type[Effect], ...]:
    """Return the effects of a file as of when it ``changed``: the same classes each time, so traced once."""
    spec = importlib.util.spec_from_file_location(f"signlin_effect_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise ModelError(f"effect_files: {path} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise ModelError(f"effect_files: {path} fails: {type(error).__name__}: {error}") from error
    found = [
        c
        for c in vars(module).values()
        if inspect.isclass(c) and issubclass(c, Effect) and c.__module__ == module.__name__
    ]
    if not found:
        raise ModelError(f"effect_files: {path} defines no subclass of signlin_ros.effects.Effect")
    return tuple(_checked(c, f"effect_files: {path}") for c in found)


__all__ = [
    "EFFECTS",
    "Effect",
    "SensorEffect",
    "find_effect",
    "load_effect_file",
    "load_entry_points",
    "origin",
    "register",
]
