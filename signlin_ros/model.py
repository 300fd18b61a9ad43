"""A model: plant, effects, numbers and options. YAML in and out; immutable."""

from __future__ import annotations

import functools
import math
import os
import re
import sysconfig
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import ArrayLike, NDArray

from signlin_ros import sign
from signlin_ros.effects import Effect, SensorEffect, find_effect, load_effect_file
from signlin_ros.errors import InputError, ModelError, choices, suggest
from signlin_ros.files import write_text
from signlin_ros.markup import html_table
from signlin_ros.names import TIME
from signlin_ros.par import (
    Par,
    Pars,
    as_law_sees,
    check_values,
    declared_name,
    gathered,
    nominal_values,
    place_of,
)
from signlin_ros.plants import Plant, find_plant
from signlin_ros.sensors import Sensor
from signlin_ros.trace import EffectSlot, Structure, Trace, delay_of, resolve_unit, trace

METHODS = ("optimal", "termwise", "jacobian")
OPERATING_POINTS = ("start", "midpoint")
AXES = ("rotary", "linear")
WHOLE = 1e-9
"""How far from a whole number an order may be that is called whole."""
TOLERANCE = 0.05
"""By how much base parameters may be off, where a model does not say."""
HOLDS = {"forward": 0.0, "centred": 0.5, "backward": 1.0}
"""By how many steps an input precedes its sample: a command that is held; samples of what goes on in between; what was
logged beside the state that it led to."""
SUFFIXES = (".yaml", ".yml")
"""Suffixes of model files."""
RESERVED_KEYS = ("use_sim_time", "qos_overrides", "start_type_description_service")
"""Keys of ROS 2 itself, accepted everywhere."""
NODE_KEYS = (
    *("publish_rate", "noise", "seed", "input_signal", "amplitude", "input_period", "joint_name"),
    *("state_source", "state_timeout", "record", "rate", "loop", "publish_clock"),
    *("design", "track", "control_period", "limit", "loop_delay", "largest_speed", "bandwidth", "damping", "integral"),
    *("tolerance_at_rest", "floor", "friction_share", "turning", "reference_timeout", "model_timeout"),
    "needs_model",
    *("autostart", "observer", "model_file", "linearizer", "window", "learn", "warn_above", "folder"),
)
"""Keys of the nodes (docs/nodes), accepted by every verb."""


@dataclass(frozen=True)
class EffectUse:
    """An effect in a model: its type and the values of its parameters, of lists those of their elements (``A[0]``)."""

    type: str
    parameters: dict[str, float]

    def written(self) -> dict[str, Any]:
        """Return the type and the parameters as a model file has them: lists as lists, words as words."""
        pars = find_effect(self.type, "effects").pars()
        found: dict[str, Any] = {"type": self.type}
        for name, value in gathered(self.parameters).items():
            found[name] = pars[name].written(value) if name in pars and pars[name].words else value
        return found


@dataclass(frozen=True)
class Model:
    """A plant with effects, numbers and options; every ``with_...`` method returns a new model.

    Units are SI; `units` says which for each state, input and output, `par_declarations` for each parameter.
    """

    plant: type[Plant]
    parameters: dict[str, float]
    effects: dict[str, EffectUse] = field(default_factory=dict)
    sign_order: int = 50
    sign_scale: float = 1.0
    operating_range: dict[str, float] = field(default_factory=dict)
    linearization: str = ""
    operating_point: str = "start"
    input_hold: str | float = ""
    update_period: float = 0.2
    state_weights: dict[str, float] = field(default_factory=dict)
    initial_state: dict[str, float] = field(default_factory=dict)
    tolerance: float | dict[str, float] = TOLERANCE
    frozen: tuple[str, ...] = ()
    signals: dict[str, str] = field(default_factory=dict)
    effect_files: tuple[str, ...] = ()
    with_position: bool = False
    with_load_torque: bool = False
    axis: str = ""
    gear: float = 1.0
    node_options: dict[str, Any] = field(default_factory=dict)
    source: str = field(default="model", compare=False)
    folder: Path = field(default=Path(), compare=False)

    # ---------------------------------------------------------------- reading

    @classmethod
    def load(cls, path: str | Path) -> Model:
        """Read a model file, or a shipped model by its name (``dc_motor``); raise `ModelError` on any fault."""
        file = find_model_file(path)
        try:
            content = yaml.load(file.read_text(encoding="utf-8"), Loader=_Loader)
        except (yaml.YAMLError, UnicodeDecodeError) as error:
            raise ModelError(f"{file}: not a YAML file: {' '.join(str(error).split())}") from error
        except OSError as error:
            raise ModelError(f"{file}: {error.strerror}") from error
        except ModelError as error:
            raise ModelError(f"{file}: {error}") from error
        return cls.from_dict(_parameters_of(content, str(file)), source=str(file), folder=file.parent)

    @classmethod
    def from_yaml(cls, text: str, source: str = "model", folder: Path = Path()) -> Model:
        """Read the text of a model file; ``folder`` is what effect files are relative to."""
        try:
            content = yaml.load(text, Loader=_Loader)
        except yaml.YAMLError as error:
            raise ModelError(f"{source}: not a YAML file: {' '.join(str(error).split())}") from error
        return cls.from_dict(_parameters_of(content, source), source, folder)

    @classmethod
    def from_dict(cls, mapping: Mapping[str, Any], source: str = "model", folder: Path = Path()) -> Model:
        """Build a model from what stands below ``ros__parameters``; raise `ModelError` naming source and key."""
        try:
            return _read(mapping, source, folder)
        except ModelError as error:
            raise ModelError(f"{source}: {error}") from error

    # ---------------------------------------------------------------- writing

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping that `from_dict` reads; options at their defaults are left out."""
        content: dict[str, Any] = {"plant": self.plant.name, "parameters": dict(self.parameters)}
        if self.effects:
            content["effects"] = {
                key: {name: value for name, value in use.written().items() if name != "type" or value != key}
                for key, use in self.effects.items()
            }
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name in _OPTIONS and value != _default(item.name, self.plant):
                content[item.name] = list(value) if isinstance(value, tuple) else value
        return content | self.node_options

    def to_yaml(self) -> str:
        """Return the text of a ROS 2 parameter file that holds this model without loss."""
        tree = {"/**": {"ros__parameters": self.to_dict()}}
        return yaml.dump(tree, Dumper=_Dumper, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110)

    def save(self, path: str | Path) -> None:
        """Write `to_yaml` to a file, whole or not at all; effect files are named relative to where it stands."""
        try:
            write_text(path, self.placed_in(Path(path).parent).to_yaml())
        except OSError as error:
            raise InputError(f"cannot write {path}: {error.strerror}") from error

    # ---------------------------------------------------------------- changing

    def with_effect(self, type: str, key: str | None = None, **parameters: Any) -> Model:
        """Return a model with one more effect; parameters not given start at their nominal values.

        A list is given as a list or by its elements (``**{"A[0]": 0.1}``).

        The effect of a sensor is on the channels given, on all states and outputs if none is.
        """
        effect = find_effect(type, "effects")
        key = key or type
        if key in self.effects:
            raise ModelError(f"effects.{key}: is in the model already; give the new one another key")
        given = gathered({name.rstrip("_"): value for name, value in parameters.items()})
        present = {name: unit for name, unit in self._channels.items() if name in (*self.states, *self.outputs)}
        pars = {} if given and issubclass(effect, SensorEffect) else effect.pars_on(present)
        pars = Pars({n: p for n, p in pars.items() if not (p.free_standing and self._has_spring)})
        return self._changed(effects={**self._written, key: {"type": type, **_nominal(pars, given), **given}})

    def without_effect(self, key: str) -> Model:
        """Return a model without one effect."""
        if key not in self.effects:
            raise ModelError(f"effects.{key}: is not in the model; there are: {choices(self.effects)}")
        return self._changed(effects={k: use for k, use in self._written.items() if k != key})

    @property
    def _written(self) -> dict[str, dict[str, Any]]:
        return {key: use.written() for key, use in self.effects.items()}

    def with_parameters(self, values: Mapping[str, Any] | None = None, **more: Any) -> Model:
        """Return a model with other numbers: ``{"J": 0.002, "coulomb_friction.mu": 0.03}``.

        A list is given as a list, or an element of it (``"torque_ripple.A[0]"``).
        """
        content = self.to_dict()
        for name, value in {**(values or {}), **more}.items():
            key, inner = self._located(name)
            if declared_name(inner) not in self._pars_of(key):
                raise self._unknown(name)
            table, place = content["effects"][key] if key else content["parameters"], place_of(inner)
            if place is None:
                table[inner] = value
            elif inner in self.effects[key].parameters:
                table[declared_name(inner)][place] = value
            else:
                raise self._unknown(name)
        return Model.from_dict(content, self.source, self.folder)

    def with_options(self, **options: Any) -> Model:
        """Return a model with other options, e.g. ``sign_order=20``."""
        return self._changed(**options)

    def placed_in(self, folder: Path) -> Model:
        """Return the model as a file in a folder has it: its effect files named relative to that folder."""
        given = ((name, self.folder / name) for name in self.effect_files)
        names = (n if Path(n).is_absolute() else _relative(file, folder) for n, file in given)
        return replace(self, effect_files=tuple(names), folder=folder)

    def _changed(self, **entries: Any) -> Model:
        return Model.from_dict({**self.to_dict(), **entries}, self.source, self.folder)

    def _pars_of(self, key: str) -> Pars:
        return _effect_class(self.effects[key]).pars_on(self._channels) if key else self.plant.pars()

    def _located(self, name: str) -> tuple[str, str]:
        """Return the key of an effect of the model (empty: the plant) and a parameter from a dotted name."""
        key, _, inner = name.removeprefix("parameters.").removeprefix("effects.").rpartition(".")
        if key and key not in self.effects:
            raise self._unknown(name)
        inner = inner.rstrip("_")
        sensor = bool(key) and _is_sensor(self.effects[key])
        return key, _own_name(self.plant, inner, self._channels) if sensor else inner

    def _unknown(self, name: str) -> ModelError:
        known = [n.split(".", 1)[1] for n in self.par_declarations()]
        return ModelError(f"{name}: unknown parameter; known: {choices(known)}{suggest(name, known)}")

    # ---------------------------------------------------------------- looking

    @property
    def files(self) -> dict[Path, str]:
        """What the model was read from, its own file and those of its effects, and what each is."""
        own = {Path(self.source): f"the model {self.source}"}
        return own | {self.folder / name: f"the effect file {name}" for name in self.effect_files}

    @functools.cached_property
    def structure(self) -> Structure:
        """What decides the equations, without the numbers (hashable)."""
        pars = self.plant.pars()
        built_in = tuple(
            EffectSlot(name, find_effect(name, "plant"), (), taken, built_in=True)
            for name, taken in self.plant.built_in.items()
        )
        return Structure(
            plant=self.plant,
            plant_structural=tuple((n, self.parameters[n]) for n, par in pars.items() if par.structural),
            zeros=tuple(n for n in self.plant.zero_matters if self.parameters[n] == 0.0),
            slots=built_in + tuple(_slot(key, use) for key, use in self.effects.items() if not _is_sensor(use)),
            with_position=self.with_position or "position" in self.signals or self._senses_position,
            with_load_torque=self.with_load_torque,
        )

    @property
    def trace(self) -> Trace:
        """The equations with recorded signs."""
        found: Trace | None = self.__dict__.get("_trace")
        if found is None:  # no cached property: its lock would be held while another thread writes expressions
            found = self.__dict__["_trace"] = trace(self.structure)
        return found

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: no expressions, which CasADi does not let go."""
        return {name: value for name, value in self.__dict__.items() if name != "_trace"}

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states, in order."""
        return self.trace.states

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs, in order."""
        return self.trace.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs: the states, or what the plant says."""
        return self.trace.outputs

    @property
    def units(self) -> dict[str, str]:
        """Unit of every state, input and output."""
        return self.trace.units

    @functools.cached_property
    def sensors(self) -> dict[str, Sensor]:
        """What measures each state and output: perfect but for what the sensor effects say of it."""
        found = dict.fromkeys((*self.states, *self.outputs), Sensor())
        for use in self.effects.values():
            effect = _effect_class(use)()
            if isinstance(effect, SensorEffect):
                for channel, value in use.parameters.items():
                    found[channel] = effect.sensor(found[channel], value)
        return found

    def shown_states(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return what the sensors show of states (..., n), each in its own time (`Sensor.show`)."""
        return self._by_sensor(Sensor.show, x)

    def true_states(self, y: ArrayLike) -> NDArray[np.float64]:
        """Return the states (..., n) behind what the sensors show, each in its own time (`Sensor.true`)."""
        return self._by_sensor(Sensor.true, y)

    def _by_sensor(self, how: Callable[[Sensor, Any], Any], values: ArrayLike) -> NDArray[np.float64]:
        columns = np.moveaxis(np.asarray(values, dtype=float), -1, 0)
        pairs = zip(self.states, columns, strict=True)
        with np.errstate(over="ignore"):
            return np.stack([how(self.sensors[name], column) for name, column in pairs], axis=-1)

    @property
    def _senses_position(self) -> bool:
        sensed = (name for use in self.effects.values() if _is_sensor(use) for name in use.parameters)
        return self.plant.position_optional and self.plant.position in sensed

    @property
    def _channels(self) -> dict[str, str]:
        return self.plant.channels(self.parameters)

    @property
    def _has_spring(self) -> bool:
        return _has_spring(self.plant, self.parameters)

    @functools.cached_property
    def p(self) -> NDArray[np.float64]:
        """Values of the trace's parameters, in its order."""
        return np.array([self.value(name) for name in self.trace.parameters])

    @property
    def is_rotary(self) -> bool | None:
        """Whether the axis turns; None where neither the model nor its plant says (a record's units may)."""
        axis = self.axis or ("rotary" if self.plant.position_unit == "rad" else "")
        return axis == "rotary" if axis else None

    def turns(self, units: Mapping[str, str]) -> bool:
        """Tell whether the axis turns: as the model, its plant or the units of a record's signals say."""
        unit = units.get(self.plant.position) or units.get(self.plant.velocity, "")
        return unit.startswith("rad") if self.is_rotary is None else self.is_rotary

    @property
    def early(self) -> float:
        """By how many steps a recorded input precedes its sample (`HOLDS`); 0 where the model does not say."""
        return HOLDS.get(self.input_hold, 0.0) if isinstance(self.input_hold, str) else self.input_hold

    @functools.cached_property
    def delay(self) -> float:
        """Delay of the input in s."""
        return delay_of(self.trace, self.p)

    def value(self, name: str) -> float:
        """Return a parameter's value by dotted name: ``J`` or ``parameters.J``, ``coulomb_friction.mu``."""
        key, inner = self._located(name)
        table = self.effects[key].parameters if key else self.parameters
        if inner not in table:
            raise self._unknown(name)
        return table[inner]

    def tolerance_of(self, name: str) -> float:
        """Return how far a base parameter may be off, relative to its value: 0 where no fit may move it."""
        if name in self.frozen:
            return 0.0
        stated = self.tolerance
        return float(stated.get(name, TOLERANCE) if isinstance(stated, dict) else stated)

    def par_declarations(self) -> dict[str, Par]:
        """Return every parameter's declaration by ROS name (``effects.coulomb_friction.mu``), units resolved."""
        found = {f"parameters.{name}": par for name, par in self.plant.pars().items()}
        for key, use in self.effects.items():
            pars = self._pars_of(key)
            found |= {f"effects.{key}.{name}": pars[name] for name in use.parameters}
        return {name: replace(par, unit=resolve_unit(par.unit, self.plant)) for name, par in found.items()}

    def _repr_html_(self) -> str:
        pars = {name.split(".", 1)[1]: par for name, par in self.par_declarations().items()}
        rows = [[name, f"{self.value(name):.6g}", par.unit, par.doc] for name, par in pars.items()]
        return html_table(["parameter", "value", "unit", ""], rows, f"{self.plant.name} ({self.source})")

    def canonical(self, name: str) -> str:
        """Return the plant's own name for a state, input or output, resolving position, velocity and effort."""
        known = (*self.states, *self.inputs, *self.outputs)
        plain = _own_name(self.plant, name, known)
        if plain not in known:
            hint = suggest(name, known)
            if plain == self.plant.position:
                hint = f"; with_position: true makes the {plain} a state"
            elif plain in self.plant.sometimes:
                hint = f"; {self.plant.sometimes[plain]}"
            raise ModelError(f"{name!r} is no state, input or output; there are: {choices(known)}{hint}")
        return plain

    def state_vector(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return x (n,) from values by name; states not named are 0."""
        return self._vector(values, self.states, "state")

    def input_vector(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return u (m,) from values by name; inputs not named are 0."""
        return self._vector(values, self.inputs, "input")

    def _vector(self, values: Mapping[str, float], names: tuple[str, ...], what: str) -> NDArray[np.float64]:
        out = np.zeros(len(names))
        for name, value in values.items():
            plain = self.canonical(name)
            if plain not in names:
                raise ModelError(f"{name!r} is no {what}; the {what}s are: {', '.join(names)}")
            out[names.index(plain)] = value
        return out

    @property
    def x0(self) -> NDArray[np.float64]:
        """The initial state (n,)."""
        return self.state_vector(self.initial_state)


# -------------------------------------------------------------------- files


def shipped_models() -> dict[str, Path]:
    """Return the model files that come with the package, by name."""
    here = Path(__file__).parent
    prefixes = (*here.parents, Path(sysconfig.get_path("data")))  # of a ROS 2 workspace, of a virtual environment
    places = (here.parent / "config", *(prefix / "share" / "signlin_ros" / "config" for prefix in prefixes))
    for place in places:
        files = {f.stem: f for f in sorted(place.glob("*.yaml"))}
        if "dc_motor" in files:
            return files
    return {}


def find_model_file(path: str | Path) -> Path:
    """Return the file for a path or a shipped name; raise `ModelError` naming the nearest shipped one."""
    file = Path(path)
    if file.is_file():
        return file
    shipped = shipped_models()
    if str(path) in shipped:
        return shipped[str(path)]
    if file.is_dir():
        raise ModelError(f"{path}: is a folder, not a model file")
    raise ModelError(f"{path}: no such model file; shipped models: {choices(shipped)}{suggest(str(path), shipped)}")


def _relative(file: Path, folder: Path) -> str:
    """Return how a file is called from a folder; links among the folders on the way do not lead astray."""
    return os.path.relpath(file.parent.resolve() / file.name, folder.resolve())


def _parameters_of(content: Any, file: str) -> Mapping[str, Any]:
    """Return the mapping below ``ros__parameters`` of the one node, or wildcard, that the file speaks of."""
    if not isinstance(content, Mapping) or not content:
        raise ModelError(f"{file}: empty, or not a ROS 2 parameter file (/**: ros__parameters: ...)")
    blocks = [v["ros__parameters"] for v in content.values() if isinstance(v, Mapping) and "ros__parameters" in v]
    blocks = [block for block in blocks if isinstance(block, Mapping) and "plant" in block] or blocks
    if len(blocks) != 1 or not isinstance(blocks[0], Mapping):
        found = choices(str(k) for k in content)
        raise ModelError(
            f"{file}: found top-level key(s) {found}; allowed: one node or /** with ros__parameters below it"
        )
    return blocks[0]


class _Loader(yaml.SafeLoader):
    """Reads ``1e5`` and ``1.0e5`` as numbers, as ROS 2 does (YAML 1.1 takes them for text), and no key twice."""

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        """Return a mapping as it stands; raise `ModelError` for a key that stands in it twice."""
        node = super().compose_mapping_node(anchor)
        lines: dict[str, int] = {}
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            line = key.start_mark.line + 1
            if key.value in lines:
                raise ModelError(f"{key.value}: given twice, in line {lines[key.value]} and in line {line}")
            lines[key.value] = line
        return node


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"), list("-+.0123456789")
)


class _Dumper(yaml.SafeDumper):
    """Floats that YAML 1.1 reads back as floats (``1.0e-06``), and short mappings on one line."""


def _represent_float(dumper: yaml.SafeDumper, value: float) -> yaml.Node:
    text = repr(float(value))
    if "e" in text and "." not in text:
        text = text.replace("e", ".0e")
    return dumper.represent_scalar("tag:yaml.org,2002:float", text)


_Dumper.add_representer(float, _represent_float)


# -------------------------------------------------------------------- reading a mapping


def _number(value: Any, where: str, low: float, high: float, unit: str = "", positive: bool = False) -> float:
    return Par(unit, 0.0, low, high, "", positive=positive).check(value, where)


def _choice(allowed: tuple[str, ...]) -> Callable[[Any, str], str]:
    def check(value: Any, where: str) -> str:
        if value not in allowed:
            raise ModelError(f"{where}: found {value!r}; allowed: {', '.join(allowed)}{suggest(str(value), allowed)}")
        return str(value)

    return check


def _boolean(value: Any, where: str) -> bool:
    if not isinstance(value, bool):
        raise ModelError(f"{where}: found {value!r}; allowed: true or false")
    return value


def _names(value: Any, where: str) -> tuple[str, ...]:
    if not isinstance(value, (list, tuple)) or not all(isinstance(item, str) for item in value):
        raise ModelError(f"{where}: found {value!r}; allowed: a list of names")
    return tuple(value)


def _table(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise ModelError(f"{where}: found {value!r}; allowed: a mapping such as {{name: value}}")
    return {str(name): item for name, item in _flat(value)}


def _flat(value: Mapping[Any, Any], prefix: str = "") -> Any:
    """Yield dotted names, so that ``{bouc_wen_hysteresis: {h: 0.1}}`` names the state ``bouc_wen_hysteresis.h``."""
    for name, item in value.items():
        if isinstance(item, Mapping):
            yield from _flat(item, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", item


def _number_table(low: float, positive: bool = False) -> Callable[[Any, str], dict[str, float]]:
    def check(value: Any, where: str) -> dict[str, float]:
        items = _table(value, where).items()
        return {name: _number(item, f"{where}.{name}", low, math.inf, positive=positive) for name, item in items}

    return check


def _signals(value: Any, where: str) -> dict[str, str]:
    table = dict(_table(value, where))
    for name, item in table.items():
        if isinstance(item, (int, float)) and not isinstance(item, bool) and math.isfinite(item):
            column = isinstance(item, int) and item > 0 and name not in TIME
            table[name] = str(item) if column else repr(float(item))
        elif not isinstance(item, str) or not item.strip():
            allowed = "a column's name or number, a formula of columns, or /topic.field[...]; for t also the s from row"
            allowed += " to row, for an input also a number, 0.0, that it is throughout"
            raise ModelError(f"{where}.{name}: found {item!r}; allowed: {allowed}")
    return table


def _tolerance(value: Any, where: str) -> float | dict[str, float]:
    if isinstance(value, Mapping):
        return _number_table(0.0)(value, where)
    return _number(value, where, 0.0, 10.0)


def _order(value: Any, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value or abs(value) == math.inf:
        raise ModelError(f"{where}: found {value!r}; allowed: a whole number from 1 to {sign.MAX_ORDER}")
    try:
        return sign.check_order(value)  # type: ignore[arg-type]
    except InputError as error:
        raise ModelError(str(error)) from error


def _hold(value: Any, where: str) -> str | float:
    if isinstance(value, str) and value in HOLDS:
        return value
    if isinstance(value, (int, float)) and not isinstance(value, bool) and 0.0 <= value <= 1.0:
        return next((name for name, early in HOLDS.items() if early == value), float(value))
    allowed = f"{', '.join(HOLDS)}, or by how many steps it precedes its sample, 0 to 1"
    raise ModelError(f"{where}: found {value!r}; allowed: {allowed}{suggest(str(value), HOLDS)}")


_OPTIONS: dict[str, Callable[[Any, str], Any]] = {
    "sign_order": _order,
    "sign_scale": lambda v, w: _number(v, w, 0.0, 1e12),
    "operating_range": _number_table(0.0, positive=True),
    "linearization": _choice(METHODS),
    "operating_point": _choice(OPERATING_POINTS),
    "input_hold": _hold,
    "update_period": lambda v, w: _number(v, w, 0.0, 3600.0, "s", positive=True),
    "state_weights": _number_table(0.0),
    "initial_state": _number_table(-math.inf),
    "tolerance": _tolerance,
    "frozen": _names,
    "signals": _signals,
    "effect_files": _names,
    "with_position": _boolean,
    "with_load_torque": _boolean,
    "axis": _choice(AXES),
    "gear": lambda v, w: _number(v, w, 0.0, 1e6, positive=True),
}


def _default(name: str, plant: type[Plant]) -> Any:
    if name == "linearization":
        return plant.linearization
    item = next(f for f in fields(Model) if f.name == name)
    return item.default_factory() if callable(item.default_factory) else item.default


def _nominal(pars: Pars, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return nominal values as a model file has them; a list that goes along with a given one is left to its default,
    or as long as that.
    """
    values = {n: v if isinstance(v, list) else pars[n].written(v) for n, v in gathered(nominal_values(pars)).items()}
    for name, par in pars.items():
        if not isinstance(given.get(par.along), (list, tuple)):
            continue
        del values[name]
        if par.default is None:
            values[name] = [par.element(i).nominal for i in range(len(given[par.along]))]
    return values


def _effect_class(use: EffectUse) -> type[Effect]:
    return find_effect(use.type, "effects")


def _is_sensor(use: EffectUse) -> bool:
    return issubclass(_effect_class(use), SensorEffect)


def _has_spring(plant: type[Plant], base: Mapping[str, float]) -> bool:
    return "k" in base and not ("k" in plant.zero_matters and base["k"] == 0.0)


def _own_name(plant: type[Plant], name: str, known: Collection[str]) -> str:
    """Return the plant's own name for position, velocity or effort, unless it is a known name itself."""
    return name if name in known else plant.aliases().get(name, name)


def _slot(key: str, use: EffectUse) -> EffectSlot:
    effect = _effect_class(use)
    pars = effect.pars()
    structural = tuple((n, v) for n, v in use.parameters.items() if pars[n].structural)
    return EffectSlot(key, effect, structural, tuple(use.parameters))


def _effects(value: Any, plant: type[Plant], base: Mapping[str, float]) -> dict[str, EffectUse]:
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise ModelError(f"effects: found {value!r}; allowed: a mapping such as {{coulomb_friction: {{mu: 0.033}}}}")
    return {str(key): _effect(str(key), item, plant, base) for key, item in value.items()}


def _effect(key: str, item: Any, plant: type[Plant], base: Mapping[str, float]) -> EffectUse:
    where = f"effects.{key}"
    if "." in str(key):
        raise ModelError(f"{where}: a key must not have a dot: ROS parts names there")
    if item is not None and not isinstance(item, Mapping):
        raise ModelError(f"{where}: found {item!r}; allowed: a mapping of its parameters")
    given = dict(item or {})
    name = given.pop("type", key)
    effect: type[Effect] = find_effect(str(name), where)
    if effect.plants and plant.name not in effect.plants:
        raise ModelError(f"{where}: {name} does not apply to {plant.name}, only to {', '.join(effect.plants)}")
    if name in plant.built_in:
        raise ModelError(f"{where}: {name} is part of the plant {plant.name} already")
    pars = effect.pars_on(plant.channels(base))
    if issubclass(effect, SensorEffect):
        return EffectUse(str(name), _by_channel(pars, given, plant, where))
    pars = pars.with_units(lambda unit: resolve_unit(unit, plant))
    values, spring = check_values(pars, given, where), _has_spring(plant, base)
    for free in (n for n, par in pars.items() if par.free_standing):
        if spring and free in values:
            raise ModelError(f"{where}.{free}: the plant {plant.name} has a spring of its own; leave it out")
        if not spring and free not in values:
            raise ModelError(f"{where}.{free}: missing; the plant has no spring of its own ({pars[free].doc})")
    fault = effect.fault(as_law_sees(pars, values))
    if fault:
        raise ModelError(f"{where}.{fault}")
    return EffectUse(str(name), values)


def _by_channel(pars: Mapping[str, Par], given: Mapping[str, Any], plant: type[Plant], where: str) -> dict[str, float]:
    """Return the checked values of a sensor's effect by channel, under the plant's own names."""
    values: dict[str, float] = {}
    for name, value in given.items():
        channel = _own_name(plant, str(name), pars)
        if channel not in pars:
            near = suggest(str(name), (*pars, *(alias for alias, own in plant.aliases().items() if own in pars)))
            raise ModelError(f"{where}.{name}: unknown channel; known: {choices(pars)}{near}")
        if channel in values:
            raise ModelError(f"{where}: {channel} is given twice, once as {name}")
        values[channel] = pars[channel].check(value, f"{where}.{name}")
    if not values:
        raise ModelError(f"{where}: names no channel; allowed: {{{next(iter(pars))}: value, ...}} with {choices(pars)}")
    return values


def _read(mapping: Mapping[str, Any], source: str, folder: Path) -> Model:
    known = ("plant", "parameters", "effects", *_OPTIONS, *NODE_KEYS, *RESERVED_KEYS)
    for key in mapping:
        if key not in known:
            raise ModelError(f"{key}: unknown key; known: {choices(known)}{suggest(str(key), known)}")
    if "plant" not in mapping:
        raise ModelError("plant: missing")
    plant = find_plant(mapping["plant"], "plant")
    options = {key: check(mapping[key], key) for key, check in _OPTIONS.items() if key in mapping}
    for name in options.get("effect_files", ()):
        load_effect_file(folder / name)
    table = mapping.get("parameters", {})
    if not isinstance(table, Mapping):
        raise ModelError(f"parameters: found {table!r}; allowed: a mapping of {choices(plant.pars())}")
    values = check_values(plant.pars(), table, "parameters")
    model = Model(
        plant=plant,
        parameters=values,
        effects=_effects(mapping.get("effects"), plant, values),
        node_options={key: mapping[key] for key in mapping if key in (*NODE_KEYS, *RESERVED_KEYS)},
        source=source,
        folder=folder,
        **{"linearization": plant.linearization, **options},
    )
    _check_axis(model)
    _check_names(model)
    return model


def _check_axis(model: Model) -> None:
    """Refuse a linear axis where the plant turns, and orders that are not whole where the axis does."""
    if model.axis == "linear" and model.plant.position_unit == "rad":
        raise ModelError(f"axis: found 'linear'; allowed: rotary, the plant {model.plant.name} turns")
    for key, use in model.effects.items() if model.is_rotary else ():
        whole = _effect_class(use).whole_orders
        for name, order in ((n, v) for n, v in use.parameters.items() if declared_name(n) in whole):
            if min(abs(turns - round(turns)) for turns in (order, order / model.gear)) > WHOLE * order:
                of_motor = f", or such a number times the gear {model.gear:g}" if model.gear != 1.0 else ""
                raise ModelError(
                    f"effects.{key}.{name}: found {order:g}; allowed: a whole number, the axis is rotary{of_motor}"
                )


def _check_names(model: Model) -> None:
    """Check every option that names a state, an input or a parameter."""
    allowed = {"state_weights": model.states, "initial_state": model.states, "operating_range": None}
    for option, names in allowed.items():
        table: dict[str, float] = getattr(model, option)
        own = _own_names(option, {name: _state_name(model, option, name, names) for name in table})
        object.__setattr__(model, option, {own[name]: value for name, value in table.items()})
    _own_names("signals", {name: _signal_name(model, name) for name in model.signals})
    tolerances = model.tolerance if isinstance(model.tolerance, dict) else {}
    for option, given in (("frozen", model.frozen), ("tolerance", tolerances)):
        for name in given:
            if name not in model.parameters:
                known = f"{choices(model.parameters)}{suggest(name, model.parameters)}"
                raise ModelError(f"{option}: {name!r} is no base parameter; there are: {known}")
    if model.sign_scale == 0.0 and not model.operating_range:
        example = f"{{{model.plant.velocity}: 30.0}}"
        raise ModelError(f"operating_range: missing; sign_scale 0.0 is chosen from it, e.g. {example}")


def _own_names(option: str, own: dict[str, str]) -> dict[str, str]:
    """Return the own names by those given under an option; raise `ModelError` where two mean the same."""
    for plain, count in Counter(own.values()).items():
        if count > 1:
            given = " and as ".join(name for name, its in own.items() if its == plain)
            raise ModelError(f"{option}: {plain} is given twice, as {given}")
    return own


def _signal_name(model: Model, name: str) -> str:
    """Return the own name of what a record may hold: the time, a state, input or output, or what may be one."""
    if name in TIME:
        return TIME[0]
    perhaps = name in model.plant.optional_inputs or name in model.plant.sometimes
    return name if perhaps else _state_name(model, "signals", name, None)


def _state_name(model: Model, option: str, name: str, allowed: tuple[str, ...] | None) -> str:
    try:
        plain = model.canonical(name)
    except ModelError as error:
        raise ModelError(f"{option}: {error}") from error
    if allowed is not None and plain not in allowed:
        raise ModelError(f"{option}: {name!r} is no state; there are: {', '.join(allowed)}")
    return plain


__all__ = ["EffectUse", "Model", "find_model_file", "shipped_models"]
