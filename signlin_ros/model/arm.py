"""The model of an arm: a `Model` whose plant is made from a robot, and whose effects belong to its joints."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from signlin_ros.effects import find_effect, load_effect_file
from signlin_ros.errors import ModelError, choices, suggest
from signlin_ros.model.arm_file import KEYS, SECTION, ArmFile, Effort, Payload, arm_file, effort_of
from signlin_ros.model.files import relative
from signlin_ros.model.model import Model
from signlin_ros.model.names import check_names
from signlin_ros.model.options import ARM_METHODS, MODEL_OPTIONS, NODE_KEYS, RESERVED_KEYS
from signlin_ros.model.uses import EffectUse, effect_class, effects_of, nominal, slot
from signlin_ros.par import Par, Pars, check_values, declared_name, gathered, place_of
from signlin_ros.plants.arm import GAIN_PARAMETER, MOTOR_INERTIA, ArmPlant, arm_plant
from signlin_ros.plants.joint import joint_plant
from signlin_ros.recording.trace import Structure, resolve_unit
from signlin_ros.robots import Robot

_UNUSED = ("with_position", "with_load_torque", "axis", "gear")


@dataclass(frozen=True)
class ArmModel(Model):
    """A robot of several joints with the effects of each; names are those of `Model`, with the joint before them.

    ``effects`` by ``elbow_joint.coulomb_friction``, ``parameters`` by ``elbow_joint.motor_inertia`` and
    ``elbow_joint.gain``; ``arm`` is what only the file of an arm has, ``unloaded`` its robot without the payload.
    """

    arm: ArmFile = field(default_factory=lambda: ArmFile(""))
    unloaded: Robot | None = field(default=None, compare=False)

    @classmethod
    def from_dict(cls, mapping: Mapping[str, Any], source: str = "model", folder: Path = Path()) -> ArmModel:
        """Build the model of an arm from what stands below ``ros__parameters``; raise `ModelError` naming the key."""
        try:
            model = cls(**_fields(mapping, source, folder))
            check_names(model)
        except ModelError as error:
            raise ModelError(f"{source}: {error}") from error
        return model

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping that `from_dict` reads; what is at its default is left out."""
        content: dict[str, Any] = {"plant": "arm", **self.arm.written()}
        for item in fields(Model):
            value = getattr(self, item.name)
            default = item.default_factory() if callable(item.default_factory) else item.default
            default = {"linearization": "per_joint", "sign_scale": 0.0}.get(item.name, default)
            if item.name in MODEL_OPTIONS and value != default:
                content[item.name] = list(value) if isinstance(value, tuple) else value
        return {**content, **{name: s for name in self.robot.names if (s := self._section(name))}, **self.node_options}

    def _section(self, joint: str) -> dict[str, Any]:
        own, found = dict(self.arm.efforts).get(joint, Effort()), {}
        unit = self.robot.joints[self.robot.names.index(joint)].effort_unit
        gain = self.parameters[f"{joint}.{GAIN_PARAMETER}"]
        effort: dict[str, Any] = {"gain": gain} if gain != 1.0 or own.unit != unit else {}
        effort |= {"unit": own.unit} if own.unit != ("A" if effort else unit) else {}
        effort |= {"side": own.side} if own.side != "motor" else {}
        effort |= {"delay": own.delay} if own.delay else {}
        if effort:
            found["effort"] = effort
        inertia = self.parameters[f"{joint}.{MOTOR_INERTIA}"]
        if inertia:
            found["parameters"] = {MOTOR_INERTIA: inertia}
        uses = {key.partition(".")[2]: use for key, use in self.effects.items() if key.partition(".")[0] == joint}
        if uses:
            found["effects"] = {k: self._written_use(f"{joint}.{k}", k, u) for k, u in uses.items()}
        return found

    def _written_use(self, key: str, own: str, use: EffectUse) -> dict[str, Any]:
        """Return an effect as its section has it."""
        found = {n: v for n, v in use.written().items() if n != "type" or v != own}
        return {**found, "at": "joint"} if key in self.arm.at_joint else found

    # ---------------------------------------------------------------- changing

    def with_effect(self, type: str, key: str | None = None, **parameters: Any) -> ArmModel:
        """Return a model with one more effect of a joint: ``with_effect("elbow_joint.coulomb_friction", mu=4.3)``."""
        joint, _, name = type.rpartition(".")
        if not joint and key:
            joint = key.partition(".")[0]
        if joint not in self.robot.names:
            raise ModelError(f"{type}: no joint {joint!r}; allowed: JOINT.EFFECT with {choices(self.robot.names)}")
        effect = find_effect(name, "effects")
        key = key or f"{joint}.{name}"
        if key in self.effects:
            raise ModelError(f"{key}: is in the model already; give the new one another key")
        given = gathered({n.rstrip("_"): value for n, value in parameters.items()})
        values = {**nominal(effect.pars(), given), **given}
        content = self.to_dict()
        section = dict(content.get(joint, {}))
        section["effects"] = {**section.get("effects", {}), key.partition(".")[2]: {"type": name, **values}}
        return ArmModel.from_dict({**content, joint: section}, self.source, self.folder)

    def without_effect(self, *keys: str) -> ArmModel:
        """Return a model without some effects, by their keys."""
        unknown = next((key for key in keys if key not in self.effects), None)
        if unknown is not None:
            raise ModelError(f"{unknown}: is not in the model; there are: {choices(self.effects)}")
        return replace(self, effects={k: use for k, use in self.effects.items() if k not in keys})

    def with_parameters(self, values: Mapping[str, Any] | None = None, **more: Any) -> ArmModel:
        """Return a model with other numbers: ``{"elbow_joint.motor_inertia": 1.3}``."""
        parameters, effects = dict(self.parameters), {k: dict(use.parameters) for k, use in self.effects.items()}
        pars = self._by_name()
        for name, value in {**(values or {}), **more}.items():
            key, inner = self._located(name)
            full = f"{key}.{inner}" if key else inner
            items = value if isinstance(value, (list, tuple)) else [value]
            names = [inner] if not isinstance(value, (list, tuple)) else [f"{inner}[{i}]" for i in range(len(items))]
            table = effects[key] if key else parameters
            for one, item in zip(names, items, strict=True):
                if one not in table:
                    raise self._unknown(name)
                table[one] = pars[f"{key}.{one}" if key else one].check(item, full)
        return replace(
            self,
            parameters=parameters,
            effects={k: replace(use, parameters=effects[k]) for k, use in self.effects.items()},
        )

    def with_arm(self, arm: ArmFile) -> ArmModel:
        """Return a model with another robot, other couplings or another payload; joints stay those that they are."""
        content = {**self.to_dict(), **arm.written()}
        for key in KEYS:
            if key not in arm.written():
                content.pop(key, None)
        return ArmModel.from_dict(content, self.source, self.folder)

    def with_payload(self, payload: Payload | None) -> ArmModel:
        """Return a model with another payload."""
        return self.with_arm(replace(self.arm, payload=payload))

    def placed_in(self, folder: Path) -> ArmModel:
        """Return the model as a file in a folder has it: robot and effect files named relative to that folder."""
        files = super().placed_in(folder).effect_files
        robot = self.arm.robot
        if not self.arm.is_text and not Path(robot).is_absolute():
            robot = relative(self.folder / robot, folder)
        return replace(self, arm=replace(self.arm, robot=robot), effect_files=files, folder=folder)

    # ---------------------------------------------------------------- looking

    @property
    def arm_plant(self) -> type[ArmPlant]:
        """The plant, as what it is."""
        return self.plant  # type: ignore[return-value]

    @property
    def robot(self) -> Robot:
        """The robot with its payload."""
        return self.arm_plant.robot

    @property
    def urdf(self) -> str:
        """The text of the robot's URDF."""
        return self.arm.robot if self.arm.is_text else (self.folder / self.arm.robot).read_text(encoding="utf-8")

    @property
    def effort_delays(self) -> tuple[float, ...]:
        """Seconds by which the effort of each joint is recorded later than the motion."""
        own = dict(self.arm.efforts)
        return tuple(own.get(name, Effort()).delay for name in self.robot.names)

    @property
    def link_side(self) -> tuple[str, ...]:
        """Joints whose effort is measured on the link's side of the gear, where most friction is not in it."""
        return tuple(name for name, effort in self.arm.efforts if effort.side == "link")

    @functools.cached_property
    def structure(self) -> Structure:
        """What decides the equations, without the numbers (hashable)."""
        slots = tuple(slot(key, use) for key, use in self.effects.items())
        return Structure(self.plant, (), (), slots, True, ())

    @property
    def units(self) -> dict[str, str]:
        """Unit of every state and input."""
        return self.trace.units

    @property
    def files(self) -> dict[Path, str]:
        """What the model was read from."""
        robot = {} if self.arm.is_text else {self.folder / self.arm.robot: f"the URDF {self.arm.robot}"}
        return super().files | robot

    def _pars_of(self, key: str) -> Pars:
        return effect_class(self.effects[key]).pars() if key else self.plant.pars()

    def _by_name(self) -> Pars:
        found = Pars(self.plant.pars())
        for key, use in self.effects.items():
            pars, stub = effect_class(use).pars(), self._stub(key)
            found |= {f"{key}.{n}": replace(pars[n], unit=resolve_unit(pars[n].unit, stub)) for n in use.parameters}
        return found

    def _stub(self, key: str) -> Any:
        return joint_plant(self.robot.joints[self.robot.names.index(key.partition(".")[0])].prismatic)

    def _located(self, name: str) -> tuple[str, str]:
        """Return the key of an effect (empty: a joint's own parameter) and the parameter's name."""
        plain = name.removeprefix("parameters.").removeprefix("effects.")
        for infix in (".parameters.", ".effects.", ".effort."):  # as a model file, and so ROS, has it
            plain = plain.replace(infix, ".", 1)
        if declared_name(plain) in self.plant.pars() and place_of(plain) is None:
            return "", plain
        key, _, inner = plain.rpartition(".")
        if key not in self.effects or declared_name(inner) not in self._pars_of(key):
            raise self._unknown(name)
        return key, inner

    def _unknown(self, name: str) -> ModelError:
        known = list(self._by_name())
        return ModelError(f"{name}: unknown parameter; known: {choices(known)}{suggest(name, known)}")

    def in_file(self, name: str) -> str:
        """Return a parameter's name as a model file, and so ROS, has it: ``elbow.effects.coulomb_friction.mu``."""
        joint, _, rest = name.partition(".")
        section = {GAIN_PARAMETER: "effort", MOTOR_INERTIA: "parameters"}.get(rest, "effects")
        return f"{joint}.{section}.{rest}"

    def par_declarations(self) -> dict[str, Par]:
        """Return every parameter's declaration by name (``elbow_joint.coulomb_friction.mu``), units resolved."""
        return dict(self._by_name())


def _fields(mapping: Mapping[str, Any], source: str, folder: Path) -> dict[str, Any]:
    """Return the fields of an `ArmModel`, each checked by itself."""
    file, robot = arm_file(mapping, folder)
    options = {key: check for key, check in MODEL_OPTIONS.items() if key not in _UNUSED}
    known = ("plant", *KEYS, *options, *NODE_KEYS, *RESERVED_KEYS, *robot.names)
    for key in mapping:
        if key not in known:
            raise ModelError(f"{key}: unknown key; known: {choices(known)}{suggest(str(key), known)}")
    found = {key: check(mapping[key], key) for key, check in options.items() if key in mapping}
    method = found.get("linearization", "per_joint")
    if method not in ARM_METHODS:
        said = "its A would depend on where the joints' zeros are"
        raise ModelError(f"linearization: found {method!r}; allowed for an arm: {', '.join(ARM_METHODS)} ({said})")
    for name in found.get("effect_files", ()):
        load_effect_file(folder / name)
    sections = {name: _section(mapping.get(name), name) for name in robot.names}
    efforts = {
        joint.name: effort_of(sections[joint.name].get("effort"), f"{joint.name}.effort", joint.effort_unit)
        for joint in robot.joints
    }
    file = replace(file, efforts=tuple(efforts.items()), at_joint=_parted(sections))
    placed = file if file.is_text else replace(file, robot=str((folder / file.robot).resolve()))
    changed = 0 if file.is_text else Path(placed.robot).stat().st_mtime_ns  # a plant is kept for each state of its URDF
    plant = _plant(replace(placed, tolerance=0.0, efforts=()), changed, tuple((n, e.unit) for n, e in efforts.items()))
    values = {f"{name}.{GAIN_PARAMETER}": efforts[name].gain for name in robot.names}
    for name, section in sections.items():
        own = section.get("parameters") or {}
        values |= {f"{name}.{key}": value for key, value in own.items()}
    return {
        "plant": plant,
        "parameters": check_values(plant.pars(), values, "parameters"),
        "effects": _effects(robot, sections),
        "node_options": {key: mapping[key] for key in mapping if key in (*NODE_KEYS, *RESERVED_KEYS)},
        "source": source,
        "folder": folder,
        "arm": file,
        "unloaded": robot,
        "linearization": "per_joint",
        "sign_scale": 0.0,
        **found,
    }


def _section(value: Any, joint: str) -> dict[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise ModelError(f"{joint}: found {value!r}; allowed: a mapping of {choices(SECTION)}")
    for key in value:
        if key not in SECTION:
            raise ModelError(f"{joint}.{key}: unknown key; known: {choices(SECTION)}{suggest(str(key), SECTION)}")
    own = value.get("parameters") or {}
    if not isinstance(own, Mapping) or set(own) - {MOTOR_INERTIA}:
        raise ModelError(f"{joint}.parameters: found {own!r}; allowed: {{{MOTOR_INERTIA}: ...}}")
    return dict(value)


def _parted(sections: dict[str, dict[str, Any]]) -> tuple[str, ...]:
    """Return the keys of the effects that act on their joint and not on its motor, and take that word out of them."""
    found = []
    for name, section in sections.items():
        own = section.get("effects")
        for key, item in (own or {}).items() if isinstance(own, Mapping) else ():
            if isinstance(item, Mapping) and "at" in item:
                if item["at"] not in ("joint", "motor"):
                    raise ModelError(f"{name}.effects.{key}.at: found {item['at']!r}; allowed: joint, motor")
                section["effects"] = {**section["effects"], key: {k: v for k, v in item.items() if k != "at"}}
                found += [f"{name}.{key}"] if item["at"] == "joint" else []
    return tuple(found)


def _effects(robot: Robot, sections: Mapping[str, Mapping[str, Any]]) -> dict[str, EffectUse]:
    found: dict[str, EffectUse] = {}
    for joint in robot.joints:
        try:
            own = effects_of(sections[joint.name].get("effects"), joint_plant(joint.prismatic), {})
        except ModelError as error:
            raise ModelError(f"{joint.name}.{error}") from error
        found |= {f"{joint.name}.{key}": use for key, use in own.items()}
    return found


@functools.lru_cache(maxsize=64)
def _plant(file: ArmFile, changed: int, units: tuple[tuple[str, str], ...]) -> type[ArmPlant]:
    robot = file.loaded(file.unloaded(Path()))
    return arm_plant(robot, file.motors(robot.names), dict(units), file.at_motor(robot.names), file.at_joint)


__all__ = ["ArmModel"]
