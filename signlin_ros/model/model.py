"""A model: plant, effects, numbers and options. YAML in and out; immutable."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import ArrayLike, NDArray

from signlin_ros.effects import SensorEffect, find_effect
from signlin_ros.errors import InputError, ModelError, choices, suggest
from signlin_ros.files import write_text
from signlin_ros.markup import html_table
from signlin_ros.model.files import Dumper, Loader, find_model_file, parameters_of, relative
from signlin_ros.model.names import check_axis, check_names
from signlin_ros.model.options import AUTO, DEFAULT_TOLERANCE, INPUT_HOLDS, LINEAR, MODEL_OPTIONS
from signlin_ros.model.reading import fields_of
from signlin_ros.model.uses import EffectUse, effect_class, has_spring, is_sensor, nominal, own_name, slot
from signlin_ros.par import Par, Pars, declared_name, gathered, place_of
from signlin_ros.plants import Plant
from signlin_ros.recording.trace import (
    ROOM_TEMPERATURE,
    TEMPERATURE,
    EffectSlot,
    Structure,
    Trace,
    delay_of,
    resolve_unit,
    rotary_unit,
    trace,
)
from signlin_ros.sensors import Sensor


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
    input_hold: str | float = AUTO
    update_period: float = 0.2
    state_weights: dict[str, float] = field(default_factory=dict)
    initial_state: dict[str, float] = field(default_factory=dict)
    tolerance: float | dict[str, float] = DEFAULT_TOLERANCE
    frozen: tuple[str, ...] = ()
    signals: dict[str, str] = field(default_factory=dict)
    effect_files: tuple[str, ...] = ()
    with_position: bool = False
    with_load_torque: bool = False
    with_inputs: tuple[str, ...] = ()
    per_record: tuple[str, ...] = ()
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
            content = yaml.load(file.read_text(encoding="utf-8"), Loader=Loader)
        except (yaml.YAMLError, UnicodeDecodeError) as error:
            raise ModelError(f"{file}: not a YAML file: {' '.join(str(error).split())}") from error
        except OSError as error:
            raise ModelError(f"{file}: {error.strerror}") from error
        except ModelError as error:
            raise ModelError(f"{file}: {error}") from error
        return cls.from_dict(parameters_of(content, str(file)), source=str(file), folder=file.parent)

    @classmethod
    def from_yaml(cls, text: str, source: str = "model", folder: Path = Path()) -> Model:
        """Read the text of a model file; ``folder`` is what effect files are relative to."""
        try:
            content = yaml.load(text, Loader=Loader)
        except yaml.YAMLError as error:
            raise ModelError(f"{source}: not a YAML file: {' '.join(str(error).split())}") from error
        return cls.from_dict(parameters_of(content, source), source, folder)

    @classmethod
    def from_dict(cls, mapping: Mapping[str, Any], source: str = "model", folder: Path = Path()) -> Model:
        """Build a model from what stands below ``ros__parameters``; raise `ModelError` naming source and key."""
        if mapping.get("plant") == "arm":
            from signlin_ros.model.arm import ArmModel

            return ArmModel.from_dict(mapping, source, folder)
        try:
            model = Model(**fields_of(mapping, source, folder))
            check_axis(model)
            check_names(model)
        except ModelError as error:
            raise ModelError(f"{source}: {error}") from error
        return model

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
            if item.name in MODEL_OPTIONS and value != _default(item, self.plant):
                content[item.name] = list(value) if isinstance(value, tuple) else value
        return content | self.node_options

    def to_yaml(self) -> str:
        """Return the text of a ROS 2 parameter file that holds this model without loss."""
        tree = {"/**": {"ros__parameters": self.to_dict()}}
        return yaml.dump(tree, Dumper=Dumper, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110)

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
        return self._changed(effects={**self._written, key: {"type": type, **nominal(pars, given), **given}})

    def without_effect(self, *keys: str) -> Model:
        """Return a model without some effects, by their keys; what options say of states that go with them goes."""
        unknown = next((key for key in keys if key not in self.effects), None)
        if unknown is not None:
            raise ModelError(f"effects.{unknown}: is not in the model; there are: {choices(self.effects)}")
        if not keys:
            return self
        kept = [n for n in self.per_record if n.partition(".")[0] not in keys]
        tables = {name: getattr(self, name) for name in ("state_weights", "initial_state", "operating_range")}
        scale = self.sign_scale or Model.sign_scale
        effects = {k: use for k, use in self._written.items() if k not in keys}
        own = tuple(f"{key}." for key in keys)
        signals = {name: column for name, column in self.signals.items() if not name.startswith(own)}
        cleared = {"signals": signals, **{name: {} for name in tables}}
        bare = self._changed(effects=effects, per_record=kept, sign_scale=scale, **cleared)
        there = (*bare.states, *bare.inputs, *bare.outputs)
        left = {option: {n: v for n, v in table.items() if n in there} for option, table in tables.items()}
        ranged = left["operating_range"] or not self.operating_range
        return bare._changed(sign_scale=self.sign_scale if ranged else scale, **left)

    def keys_of(self, *types: str) -> list[str]:
        """Return the keys of the effects of some types."""
        return [key for key, use in self.effects.items() if use.type in types]

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

    def under(self, conditions: Mapping[str, float]) -> Model:
        """Return the model with the parameters that are known of a record; the equations stay the same."""
        return self.with_parameters(conditions) if conditions else self

    def with_options(self, **options: Any) -> Model:
        """Return a model with other options, e.g. ``sign_order=20``."""
        return self._changed(**options)

    def placed_in(self, folder: Path) -> Model:
        """Return the model as a file in a folder has it: its effect files named relative to that folder."""
        given = ((name, self.folder / name) for name in self.effect_files)
        names = (n if Path(n).is_absolute() else relative(file, folder) for n, file in given)
        return replace(self, effect_files=tuple(names), folder=folder)

    def _changed(self, **entries: Any) -> Model:
        return Model.from_dict({**self.to_dict(), **entries}, self.source, self.folder)

    def _pars_of(self, key: str) -> Pars:
        return effect_class(self.effects[key]).pars_on(self._channels) if key else self.plant.pars()

    def _located(self, name: str) -> tuple[str, str]:
        """Return the key of an effect of the model (empty: the plant) and a parameter from a dotted name."""
        key, _, inner = name.removeprefix("parameters.").removeprefix("effects.").rpartition(".")
        if key and key not in self.effects:
            raise self._unknown(name)
        inner = inner.rstrip("_")
        sensor = bool(key) and is_sensor(self.effects[key])
        return key, own_name(self.plant, inner, self._channels) if sensor else inner

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
            slots=built_in + tuple(slot(key, use) for key, use in self.effects.items() if not is_sensor(use)),
            with_position=self.with_position or "position" in self.signals or self._senses_position,
            optional_inputs=(*(("load_torque",) if self.with_load_torque else ()), *self._further_inputs),
        )

    @property
    def _further_inputs(self) -> tuple[str, ...]:
        """The inputs that are asked for, and the temperature where its column is named."""
        mapped = TEMPERATURE in self.signals and TEMPERATURE not in self.with_inputs
        return (*self.with_inputs, TEMPERATURE) if mapped else self.with_inputs

    @property
    def trace(self) -> Trace:
        """The equations with recorded signs."""
        found: Trace | None = self.__dict__.get("_trace")
        if found is None:  # no cached property: its lock would be held while another thread writes expressions
            found = self.__dict__["_trace"] = trace(self.structure)
        return found

    def __getstate__(self) -> dict[str, Any]:
        """Return the state to pickle, without expressions, which CasADi cannot pickle."""
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
        """Unit of every state, input and output; rotary ones where the axis is, whatever the plant's names say."""
        units = self.trace.units
        return {name: rotary_unit(unit) for name, unit in units.items()} if self.is_rotary else units

    @functools.cached_property
    def sensors(self) -> dict[str, Sensor]:
        """What measures each state and output: perfect but for what the sensor effects say of it."""
        found = dict.fromkeys((*self.states, *self.outputs), Sensor())
        for use in self.effects.values():
            effect = effect_class(use)()
            if isinstance(effect, SensorEffect):
                for channel, value in use.parameters.items():
                    found[channel] = effect.sensor(found[channel], value)
        return found

    def shown_states(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return the sensors' readings of states (..., n), each in its own time (`Sensor.show`)."""
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
        sensed = (name for use in self.effects.values() if is_sensor(use) for name in use.parameters)
        return self.plant.position_optional and self.plant.position in sensed

    @property
    def _channels(self) -> dict[str, str]:
        return self.plant.channels(self.parameters)

    @property
    def _has_spring(self) -> bool:
        return has_spring(self.plant, self.parameters)

    @functools.cached_property
    def p(self) -> NDArray[np.float64]:
        """Values of the trace's parameters, in its order."""
        return np.array([self.value(name) for name in self.trace.parameters])

    @property
    def is_rotary(self) -> bool | None:
        """Whether the axis turns; None where neither the model nor its plant says (a record's units may)."""
        axis = self.axis or ("rotary" if self.plant.position_unit == "rad" else "")
        return axis == "rotary" if axis else None

    def unit_of(self, declared: str) -> str:
        """Return a declared unit as this model has it: of its plant, rotary where the axis is."""
        return resolve_unit(declared, self.plant, self.axis == "rotary" and self.plant.position_unit == "m")

    def turns(self, units: Mapping[str, str]) -> bool:
        """Tell whether the axis turns: as the model, its plant or the units of a record's signals say."""
        unit = units.get(self.plant.position) or units.get(self.plant.velocity, "")
        return unit.startswith("rad") if self.is_rotary is None else self.is_rotary

    @property
    def asks_hold(self) -> bool:
        """Whether the records are to show how their inputs act between the samples."""
        return self.input_hold == AUTO

    @property
    def interpolates(self) -> bool:
        """Whether a recorded input is interpolated between its samples; an imposed motion, of which only the travel
        from sample to sample counts, is held in halves instead, which is the same.
        """
        return self.input_hold == LINEAR and not self.plant.motion_is_imposed()

    @property
    def early(self) -> float:
        """By how many steps a recorded input precedes its sample (`INPUT_HOLDS`); 0 where the model does not say, or
        `interpolates`.
        """
        if not isinstance(self.input_hold, str):
            return self.input_hold
        halves = self.input_hold == LINEAR and not self.interpolates
        return INPUT_HOLDS["centred"] if halves else INPUT_HOLDS.get(self.input_hold, 0.0)

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
        return float(stated.get(name, DEFAULT_TOLERANCE) if isinstance(stated, dict) else stated)

    def par_declarations(self) -> dict[str, Par]:
        """Return every parameter's declaration by ROS name (``effects.coulomb_friction.mu``), units resolved."""
        found = {f"parameters.{name}": par for name, par in self.plant.pars().items()}
        for key, use in self.effects.items():
            pars = self._pars_of(key)
            found |= {f"effects.{key}.{name}": pars[name] for name in use.parameters}
        return {name: replace(par, unit=self.unit_of(par.unit)) for name, par in found.items()}

    def _repr_html_(self) -> str:
        pars = {name.split(".", 1)[1]: par for name, par in self.par_declarations().items()}
        rows = [[name, f"{self.value(name):.6g}", par.unit, par.doc] for name, par in pars.items()]
        return html_table(["parameter", "value", "unit", ""], rows, f"{self.plant.name} ({self.source})")

    def canonical(self, name: str) -> str:
        """Return the plant's own name for a state, input or output, resolving position, velocity and effort."""
        known = (*self.states, *self.inputs, *self.outputs)
        plain = own_name(self.plant, name, known)
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
        """Return u (m,) from values by name; inputs not named are as in `u0`."""
        return self._vector(values, self.inputs, "input", self.u0)

    def _vector(
        self, values: Mapping[str, float], names: tuple[str, ...], what: str, rest: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        out = np.zeros(len(names)) if rest is None else rest.copy()
        for name, value in values.items():
            plain = self.canonical(name)
            if plain not in names:
                raise ModelError(f"{name!r} is no {what}; the {what}s are: {', '.join(names)}")
            out[names.index(plain)] = value
        return out

    @property
    def u0(self) -> NDArray[np.float64]:
        """The inputs (m,) where nothing is said of them: 0, or what the plant takes for one that is not recorded."""
        known = {TEMPERATURE: ROOM_TEMPERATURE, **self.plant.unrecorded(self.parameters)}
        return np.array([known.get(name, 0.0) for name in self.inputs])

    @property
    def x0(self) -> NDArray[np.float64]:
        """The initial state (n,)."""
        return self.state_vector(self.initial_state)


def _default(item: Field[Any], plant: type[Plant]) -> Any:
    if item.name == "linearization":
        return plant.linearization
    return item.default_factory() if callable(item.default_factory) else item.default


__all__ = ["Model"]
