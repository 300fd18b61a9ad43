"""The catalogue of physical effects: one file each, one line each in `CATALOGUE`.

A user's own effect is a Python file named in a model's ``effect_files``, or an entry point in the group
``signlin_ros.effects``; `register` adds it.
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import importlib.util
import inspect
from collections import Counter
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType

from signlin_ros.effects.base import Effect, SensorEffect
from signlin_ros.effects.declared import check_declared
from signlin_ros.errors import ModelError, choices, suggest

CATALOGUE = (
    "viscous_friction",
    "coulomb_friction",
    "stribeck_friction",
    "asymmetric_viscous_friction",
    "cubic_viscous_friction",
    "power_law_friction",
    "quadratic_drag",
    "load_dependent_friction",
    "load_dependent_stribeck",
    "temperature_dependent_friction",
    "constant_load",
    "gravity_load",
    "cogging_torque",
    "torque_ripple",
    "linear_stiffness",
    "cubic_stiffness",
    "asymmetric_stiffness",
    "hard_stop",
    "dahl_presliding",
    "play_friction",
    "lugre_friction",
    "bouc_wen_hysteresis",
    "pinching_hysteresis",
    "maxwell_element",
    "compliant_load",
    "backlash",
    "learned_force",
    "input_offset",
    "input_deadzone",
    "input_saturation",
    "input_delay",
    "torque_constant_saturation",
    "thermal_resistance",
    "sensor_offset",
    "sensor_gain",
    "sensor_delay",
)
"""The modules of this folder that hold an effect of the same name, in the order of listings and of the search."""
EFFECTS: dict[str, type[Effect]] = {}
"""Every known effect by its name in model files."""
_ORIGINS: dict[type[Effect], str] = {}
"""The file or entry point that an effect comes from."""


def register(effect: type[Effect]) -> type[Effect]:
    """Add an effect to the catalogue; usable as a class decorator. Registering a name anew replaces it."""
    EFFECTS[effect.name] = effect
    return effect


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
    """Return the class, if it is an effect with a name and an equation; raise `ModelError` otherwise."""
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


def kin_of(name: str) -> list[str]:
    """Return the other effects of an effect's family, in the order of the catalogue; none where it has no family."""
    family = find_effect(name, "effects").family
    return [n for n, other in EFFECTS.items() if family and other.family == family and n != name]


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


def _classes(module: ModuleType) -> list[type[Effect]]:
    """Return the effects that a module defines."""
    own = [c for c in vars(module).values() if inspect.isclass(c) and c.__module__ == module.__name__]
    return [c for c in own if issubclass(c, Effect)]


class _Source(SourceFileLoader):
    """Runs what a file says: bytecode that lies beside it may be of something else."""

    def get_code(self, fullname: str) -> CodeType:
        """Return the compiled source."""
        return self.source_to_code(self.get_data(self.path), self.path)


@functools.cache
def _effects_in(path: Path, changed: int) -> tuple[type[Effect], ...]:
    """Return the effects of a file as of when it ``changed``: the same classes each time, so traced once."""
    name = f"signlin_effect_{path.stem}"
    loader = _Source(name, str(path))
    spec = importlib.util.spec_from_file_location(name, path, loader=loader) if path.suffix == ".py" else None
    if spec is None or spec.loader is None:
        raise ModelError(f"effect_files: {path} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise ModelError(f"effect_files: {path} fails: {type(error).__name__}: {error}") from error
    found = _classes(module)
    if not found:
        raise ModelError(f"effect_files: {path} defines no subclass of signlin_ros.effects.Effect")
    return tuple(_checked(c, f"effect_files: {path}") for c in found)


for _name in CATALOGUE:
    for _effect in _classes(importlib.import_module(f"{__name__}.{_name}")):
        register(_effect)

__all__ = [
    "CATALOGUE",
    "EFFECTS",
    "Effect",
    "SensorEffect",
    "find_effect",
    "kin_of",
    "load_effect_file",
    "load_entry_points",
    "origin",
    "register",
]
