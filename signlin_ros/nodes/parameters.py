"""A model as ROS parameters: declared with description, unit and range, checked and changed at run time."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rcl_interfaces.srv import ListParameters
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node
from rclpy.parameter import Parameter

from signlin_ros.errors import InputError, suggest
from signlin_ros.model import Model
from signlin_ros.nodes import overrides
from signlin_ros.nodes.description import with_description
from signlin_ros.nodes.overrides import Overridable


class ModelNode(Node):  # type: ignore[misc]
    """A node whose parameters are a model file, and some options of its own.

    ``follows`` says whether the node follows a model that changes while it runs; without it every parameter of the
    model is read-only.
    """

    def __init__(self, name: str, options: Mapping[str, Overridable], follows: bool = False) -> None:
        super().__init__(name)
        arguments = sys.argv
        given = {key: parameter.value for key, parameter in self._parameter_overrides.items()}
        overrides.check_none_lost(given, arguments, self.get_fully_qualified_name())
        self.model = overrides.model_of(with_description(self, given), arguments)
        entries = overrides.entries_of(self.model)
        declare(self, entries if follows else {key: replace(e, read_only=True) for key, e in entries.items()})
        values = {key: entry.check(key, given.get(key, entry.value)) for key, entry in options.items()}
        declare(self, {key: replace(entry, value=values[key]) for key, entry in options.items()})
        self.options: dict[str, Any] = values

    def renew(self, model: Model) -> None:
        """Declare another model's parameters in place of those of the present one, and take it."""
        for name in overrides.entries_of(self.model):
            self.describe_parameter(name).read_only = False  # its own descriptor, not a copy
            self.undeclare_parameter(name)
        self.model = model
        declare(self, overrides.entries_of(model))

    def now(self) -> int:
        """Return the time of the node's clock in ns."""
        return int(self.get_clock().now().nanoseconds)


def declare(node: Node, entries: Mapping[str, Overridable]) -> None:
    """Declare parameters with their values.

    The values come from the overrides already, checked, and with whole numbers made floats where a float is
    meant: rclpy itself would end the node with an exception there.
    """
    for name, entry in entries.items():
        node.declare_parameter(name, entry.value, descriptor(entry), ignore_override=True)


def descriptor(entry: Overridable) -> ParameterDescriptor:
    """Return the descriptor of an entry."""
    result = ParameterDescriptor(description=entry.description, read_only=entry.read_only)
    if entry.choices:
        result.additional_constraints = f"one of: {', '.join(entry.choices)}"
    if isinstance(entry.value, bool) or entry.low == -float("inf"):
        return result
    if isinstance(entry.value, int):
        result.integer_range = [IntegerRange(from_value=int(entry.low), to_value=int(entry.high), step=1)]
    elif isinstance(entry.value, float):
        result.floating_point_range = [FloatingPointRange(from_value=entry.low, to_value=entry.high, step=0.0)]
    return result


def on_change(
    node: Node, try_changes: Callable[[dict[str, Any]], None], apply: Callable[[dict[str, Any]], None]
) -> None:
    """Check changes before they are set, and apply them after.

    ``try_changes`` raises `InputError` to refuse; the reason goes to who asked, and nothing changes. A whole
    number for a parameter that is a float is taken as one.
    """

    def floats(parameters: Sequence[Parameter]) -> list[Parameter]:
        return [_as_declared(node, parameter) for parameter in parameters]

    def check(parameters: Sequence[Parameter]) -> SetParametersResult:
        try:
            try_changes({parameter.name: parameter.value for parameter in parameters})
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def after(parameters: Sequence[Parameter]) -> None:
        apply({parameter.name: parameter.value for parameter in parameters})

    node.add_pre_set_parameters_callback(floats)
    node.add_on_set_parameters_callback(check)
    node.add_post_set_parameters_callback(after)


def _as_declared(node: Node, parameter: Parameter) -> Parameter:
    """Return a parameter, a whole number made a float where a float is declared; refuse an unknown one."""
    if not node.has_parameter(parameter.name):
        known = node.list_parameters([], ListParameters.Request.DEPTH_RECURSIVE).names
        raise ParameterNotDeclaredException([f"{parameter.name}{suggest(parameter.name, known)}"])
    declared = node.get_parameter(parameter.name)
    if parameter.type_ == Parameter.Type.INTEGER and declared.type_ == Parameter.Type.DOUBLE:
        return Parameter(parameter.name, Parameter.Type.DOUBLE, float(parameter.value))
    if parameter.type_ == Parameter.Type.INTEGER_ARRAY and declared.type_ == Parameter.Type.DOUBLE_ARRAY:
        return Parameter(parameter.name, Parameter.Type.DOUBLE_ARRAY, [float(value) for value in parameter.value])
    return parameter
