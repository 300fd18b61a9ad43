"""ROS parameters and models, without ROS: flat dotted names to a model and back.

ROS flattens a parameter file (``effects.coulomb_friction.mu``). Here the names are put together again for
`signlin_ros.model.Model`, and a model's values are listed as what a node declares.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from signlin_ros import sign
from signlin_ros.errors import InputError, ModelError, suggest
from signlin_ros.model import ARM_METHODS, METHODS, OPERATING_POINTS, Model
from signlin_ros.par import Pars, gathered


@dataclass(frozen=True)
class Overridable:
    """One parameter of a node as it is declared: the value, and what ``ros2 param describe`` shows.

    A float or int must lie in [low, high]; a string, where there are choices, must be one of them.
    """

    value: Any
    description: str
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    read_only: bool = True

    def check(self, name: str, value: Any) -> Any:
        """Return ``value`` in the type of the entry; raise `InputError` where it does not fit."""
        if isinstance(self.value, float) and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if type(value) is not type(self.value):
            kind = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}
            raise InputError(f"{name}: found {value!r}; allowed: {kind[type(self.value)]}")
        if isinstance(value, float | int) and not self.low <= value <= self.high:
            raise InputError(f"{name}: found {value:g}; allowed: [{self.low:g}, {self.high:g}]")
        if self.choices and value not in self.choices:
            hint = suggest(str(value), self.choices)
            raise InputError(f"{name}: found {value!r}; allowed: {', '.join(self.choices)}{hint}")
        return value


def nested(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return dotted names as a tree: ``{"a.b": 1}`` as ``{"a": {"b": 1}}``; raise `ModelError` on a clash."""
    tree: dict[str, Any] = {}
    for name, value in sorted(flat.items()):
        *path, last = name.split(".")
        branch = tree
        for part in path:
            branch = branch.setdefault(part, {})
            if not isinstance(branch, dict):
                raise ModelError(f"{name}: {part} has a value of its own already")
        branch[last] = value
    return tree


def model_of(flat: Mapping[str, Any], arguments: Sequence[str]) -> Model:
    """Return the model that a node's parameters describe.

    Parameters
    ----------
    flat : dotted name -> value, as ROS has read them; None for what is empty in the file.
    arguments : the command line, to find the file that ``effect_files`` are relative to.

    Raises
    ------
    ModelError
        A name that nothing declares, with the nearest known one; a value that is not allowed.
    """
    files = parameter_files(arguments)
    source = str(files[-1]) if files else "parameters"
    mapping = nested({name: value for name, value in flat.items() if value is not None or name not in _MAY_BE_EMPTY})
    if "plant" not in mapping:
        raise ModelError(
            f"{source}: plant: missing; start the node with --ros-args --params-file <model file>, "
            "for example <prefix>/share/signlin_ros/config/dc_motor.yaml"
        )
    return Model.from_dict(mapping, source, _folder(files, mapping.get("effect_files", ())))


_MAY_BE_EMPTY = {f.name for f in fields(Model) if f.default == () or f.default_factory is dict} | {"tolerance"}
"""Lists and mappings of a model file; ROS gives an empty one no value."""


def check_none_lost(flat: Mapping[str, Any], arguments: Sequence[str], node: str) -> None:
    """Raise `InputError` where ROS has kept an early value of a parameter instead of the last one.

    That happens in silence where the two stand in one section and differ in type: after a whole number, a fraction is
    lost; after any number, a text. Of several sections the one that is named last for the first time wins. ``flat`` is
    what ROS has read, ``arguments`` the command line, ``node`` the node's name with its namespace.
    """
    sections: dict[str, dict[str, list[Any]]] = {}
    for section, name, value in _given(arguments):
        if _is_for(section, node):
            sections.setdefault(section, {}).setdefault(name, []).append(value)
    winning: dict[str, list[Any]] = {}
    for values in sections.values():
        winning |= values
    for name, (*earlier, last) in winning.items():
        kept = flat.get(name)
        lost = last is not None and _rank(kept) < _rank(last) and not _alike(kept, last)
        if lost and any(_alike(kept, value) for value in earlier):
            raise InputError(
                f"{name}: {last!r} is not taken: ROS keeps the {kept!r} before it, because the type differs; "
                "write both in the same type, e.g. 1.0 for 1"
            )


def _is_for(section: str, node: str) -> bool:
    """Tell whether a section of a file is for a node; ``*`` stands for one part of its name, ``**`` for any number."""
    pattern = re.escape(f"/{section.lstrip('/')}").replace(r"/\*\*", r"(/\w+)*").replace(r"/\*", r"/\w+")
    return re.fullmatch(pattern, f"/{node.lstrip('/')}") is not None


def _rank(value: Any) -> tuple[bool, int]:
    """Return the place of a value's type in the order in which ROS looks for one; it takes the first that it finds."""
    many = isinstance(value, list)
    one = next(iter(value), None) if many else value
    return many, _TYPES.index(type(one)) if type(one) in _TYPES else len(_TYPES)


_TYPES: tuple[type, ...] = (bool, int, float, str)


def _given(arguments: Sequence[str]) -> Iterator[tuple[str, str, Any]]:
    """Yield (section, dotted name, value) of all parameters in a command line and its files, in order."""
    for flag, value in pairwise(arguments):
        if flag in ("-p", "--param"):
            rule, _, text = value.partition(":=")
            section, _, name = rule.rpartition(":")
            yield section or "/**", name, _read_yaml(text)
        elif flag == "--params-file":
            for section, body in (_read_yaml(_text_of(value)) or {}).items():
                for name, one in _flat((body or {}).get("ros__parameters") or {}):
                    yield section, name, one


def _text_of(file: str) -> str:
    """Return the content of a file; empty if it cannot be read a second time, as a pipe."""
    try:
        return Path(file).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def _flat(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _read_yaml(text: str) -> Any:
    """Return the content of a YAML text; None where PyYAML refuses what ROS has read."""
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError:
        return None


def _alike(a: Any, b: Any) -> bool:
    """Tell whether two values are equal, as numbers if they can be read as such."""

    def plain(value: Any) -> str:
        try:
            return repr(float(value))
        except (TypeError, ValueError):
            return repr(value)

    return plain(a) == plain(b)


def parameter_files(arguments: Sequence[str]) -> list[Path]:
    """Return the files named by ``--params-file`` in a command line, in order."""
    return [Path(value) for flag, value in pairwise(arguments) if flag == "--params-file"]


def _folder(files: Sequence[Path], effect_files: Iterable[str]) -> Path:
    """Return the folder of the last parameter file that has all the effect files beside it."""
    folders = [file.parent for file in reversed(files)] or [Path()]
    names = [Path(name) for name in effect_files]
    return next((f for f in folders if all((f / name).is_file() for name in names)), folders[0])


def entries_of(model: Model) -> dict[str, Overridable]:
    """Return all of a model as parameters by dotted name, so that ``ros2 param dump`` gives a model file."""
    if model.plant.name == "arm":
        return _arm_entries(model)
    found = {"plant": Overridable(model.plant.name, "base equations")}
    found |= _parameter_entries(model)
    for key, use in model.effects.items():
        found[f"effects.{key}.type"] = Overridable(use.type, "name of the effect in the catalogue")
    return found | _method_entries(model) | _fixed_entries(model)


def _arm_entries(model: Model) -> dict[str, Overridable]:
    """Return all of an arm: the numbers of its joints, which can change, and what its file says besides."""
    own = {name: value for name, value in model.to_dict().items() if name not in model.node_options}
    content = {name: value for name, value in _flat(own) if value not in ([], ())}
    found = {name: Overridable(value, "of the model file of the arm") for name, value in content.items()}
    numbers = {in_file(model, name): entry for name, entry in _parameter_entries(model).items()}
    numbers = {n: e for n, e in numbers.items() if n in content or not n.endswith(".effort.gain")}  # given: in A
    return found | numbers | {n: e for n, e in _method_entries(model).items() if not n.startswith("state_weights")}


def in_file(model: Model, name: str) -> str:
    """Return a parameter's name as ROS has it: of an arm, the joint's section stands in it."""
    return str(getattr(model, "in_file", str)(name))


def _parameter_entries(model: Model) -> dict[str, Overridable]:
    """Return the parameters of the plant and the effects; a list is one parameter, as it is one key of a model file."""
    declared, found = Pars(model.par_declarations()), {}
    for name, value in gathered({name: model.value(name) for name in declared}).items():
        par = declared[f"{name}[0]"] if isinstance(value, list) else declared[name]
        excluded = ", 0 excluded" if par.positive and par.low == 0 else ""
        text = f"{par.doc} [{par.unit}]{excluded}"
        if par.words:
            found[name] = Overridable(par.written(value), f"{par.doc}: {par.range_text()}")
        elif isinstance(value, list):
            found[name] = Overridable(value, f"{text}, each in {par.range_text()}", read_only=par.structural)
        else:
            found[name] = Overridable(value, text, par.low, par.high, read_only=par.structural)
    return found


def _method_entries(model: Model) -> dict[str, Overridable]:
    """Return the options that can change while the node runs."""
    free = partial(Overridable, read_only=False)
    found = {
        "sign_order": free(model.sign_order, "order j of sign_j", 1, sign.MAX_ORDER),
        "sign_scale": free(
            model.sign_scale,
            "scale of sign_j in the unit of each surface; 0: from operating_range",
            0,
            1e12,
        ),
        "linearization": free(
            model.linearization, "method", choices=ARM_METHODS if model.plant.name == "arm" else METHODS
        ),
        "operating_point": free(model.operating_point, "where A and B are taken", choices=OPERATING_POINTS),
        "update_period": free(model.update_period, "time between two models [s], 0 excluded", 0.0, 3600.0),
    }
    for name in model.states:
        weight = model.state_weights.get(name, 1.0)
        text = f"weight of {name} in the optimal linearization [-]; 0 leaves its column at the Jacobian's"
        found[f"state_weights.{name}"] = free(weight, text, 0.0, 1e300)
    for name, value in model.operating_range.items():
        text = f"largest |{name}| [{model.units[name]}], for sign_scale 0"
        found[f"operating_range.{name}"] = free(value, text, 0.0, 1e300)
    return found


def _fixed_entries(model: Model) -> dict[str, Overridable]:
    """Return the options that are decided when the node starts."""
    found = {
        "with_position": Overridable(model.with_position, "position as a state even where nothing needs it"),
        "with_load_torque": Overridable(model.with_load_torque, "load torque as a second input"),
        **(
            {"with_inputs": Overridable(list(model.with_inputs), "optional inputs of the plant")}
            if model.with_inputs
            else {}
        ),
        **({"per_record": Overridable(list(model.per_record), "not used by nodes")} if model.per_record else {}),
        "gear": Overridable(model.gear, "turns of the motor for one of the joint [-]; not used by nodes"),
    }
    if model.axis:
        found["axis"] = Overridable(model.axis, "rotary or linear; not used by nodes")
    if not model.asks_hold:
        found["input_hold"] = Overridable(model.input_hold, "when the input of a record acts; not used by nodes")
    for name, value in model.initial_state.items():
        found[f"initial_state.{name}"] = Overridable(value, f"initial {name} [{model.units[name]}]")
    for name, column in model.signals.items():
        found[f"signals.{name}"] = Overridable(column, f"column or topic that holds {name} in a record")
    for name, names in (("frozen", model.frozen), ("effect_files", model.effect_files)):
        if names:
            found[name] = Overridable(list(names), {"frozen": "parameters that no fit may move"}.get(name, "files"))
    tolerances = model.tolerance if isinstance(model.tolerance, dict) else {"": model.tolerance}
    for name, value in tolerances.items():
        found[f"tolerance.{name}".rstrip(".")] = Overridable(value, "relative tolerance of the base parameters [-]")
    return found


def changed(model: Model, changes: Mapping[str, Any]) -> Model:
    """Return a model with some parameters changed, all at once; names that are not the model's are ignored.

    Raises
    ------
    InputError
        A value that is not allowed, or one that would change the states or inputs.
    """
    own = {in_file(model, name) for name in model.par_declarations()} if model.plant.name == "arm" else set()
    numbers = {n: v for n, v in changes.items() if n.startswith(("parameters.", "effects.")) or n in own}
    options = {name: value for name, value in nested(changes).items() if name in _CHANGEABLE}
    for name in ("state_weights", "operating_range"):
        if name in options:
            options[name] = {**getattr(model, name), **options[name]}
    try:
        new = model.with_parameters(numbers) if numbers else model
        new = new.with_options(**options) if options else new
    except ModelError as error:
        raise InputError(_plain(str(error), model.source)) from error
    if (new.states, new.inputs) != (model.states, model.inputs):
        names = ", ".join(changes)
        raise InputError(f"{names}: this would change the states or inputs; restart the node with it instead")
    return new


_CHANGEABLE = (
    *("sign_order", "sign_scale", "linearization", "operating_point", "update_period"),
    *("state_weights", "operating_range"),
)


def _plain(message: str, source: str) -> str:
    """Return a message without the file's name before it: what is refused here came from no file."""
    while message.startswith(f"{source}: "):
        message = message.removeprefix(f"{source}: ")
    return message
