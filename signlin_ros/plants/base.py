"""What a plant is: the base equations that effects are added to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

from signlin_ros.par import HasPars


class Acting(Protocol):
    """The effects of a model, as a plant's equations see them (`signlin_ros.recording.trace`)."""

    def force(self, drive: Any, elastic: Any) -> Any:
        """Return the summed force of all effects, given the driving force and the plant's own spring force."""

    def spring(self, k: Any) -> Any:
        """Return the restoring force of the plant's spring, ``k q`` unless an effect changes it."""

    def torque_constant(self, K_t: Any) -> Any:
        """Return the torque constant as the effects leave it."""

    def resistance(self, R_a: Any) -> Any:
        """Return the armature resistance as the effects leave it."""

    def input(self, error: Any) -> Any:
        """Return the error of a plant's own control loop as the effects of the input leave it."""


class Plant(HasPars):
    """Base equations: parameters as `Par` attributes, names, and `rates`.

    ``force_unit`` and ``position_unit`` say what ``F`` and ``Q`` mean in the units of the plant and its effects.
    """

    name: ClassVar[str]
    equation: ClassVar[str]
    force_unit: ClassVar[str]
    position_unit: ClassVar[str]
    input_unit: ClassVar[str]
    position: ClassVar[str] = "displacement"
    """Name of the coordinate q."""
    velocity: ClassVar[str] = "velocity"
    """Name of the coordinate v, a state or an input."""
    position_optional: ClassVar[bool] = False
    """Whether the position is a state only where something needs it."""
    inputs: ClassVar[dict[str, str]]
    """Inputs and units."""
    optional_inputs: ClassVar[dict[str, str]] = {}
    """Inputs that a model may leave out, and units; see `unrecorded`."""
    closed_loop: ClassVar[bool] = False
    """Whether the plant holds its own control loop: its input is a goal, which effects of the input do not change (they
    act on the loop's error), and a free run stays near what was measured."""
    beside: ClassVar[tuple[str, ...]] = ()
    """What records may hold beside, as the output of the loop: records are checked by it, nothing is fitted to it."""
    benches: ClassVar[tuple[str, ...]] = ()
    """Parameters that belong to a record, as the load of a test bench does: the page asks for them."""
    scaled_by_effort: ClassVar[tuple[str, ...]] = ()
    """Parameters that a wrong scale of the input, or of a force that is measured, multiplies all alike."""
    inertia_parameter: ClassVar[str] = ""
    """The parameter that is the moving mass or inertia; empty where that is made of several."""
    effort: ClassVar[str] = "force"
    """What the alias ``effort`` means: an input, an output, or a state of the plant; empty: nothing."""
    outputs: ClassVar[dict[str, str]] = {}
    """Outputs beside the states, and units."""
    linearization: ClassVar[str] = "termwise"
    """Default method."""
    zero_matters: ClassVar[tuple[str, ...]] = ()
    """Parameters that change the equations when they are exactly 0."""
    sometimes: ClassVar[dict[str, str]] = {}
    """Quantities that are states for some parameters only, and when they are none."""
    built_in: ClassVar[dict[str, tuple[str, ...]]] = {}
    """Effects that are part of the plant, with the plant's parameters that they take."""
    own_state_names: ClassVar[dict[str, str]] = {}
    """Names of states of built-in effects, e.g. ``bouc_wen_hysteresis.h`` called ``hysteresis``."""

    @classmethod
    def motion_is_imposed(cls) -> bool:
        """Tell whether the velocity is an input: the motion is given, and no state of the plant answers to a force."""
        return cls.velocity in cls.inputs

    @classmethod
    def states(cls, values: Mapping[str, float]) -> dict[str, str]:
        """Return the plant's states and units, without an optional position; ``values`` are its parameters."""
        raise NotImplementedError

    @classmethod
    def algebraic(cls, values: Mapping[str, float]) -> dict[str, str]:
        """Return what follows states and inputs at once, and is an output beside the states, with units."""
        return {}

    @classmethod
    def settling_times(cls, values: Mapping[str, float]) -> dict[str, float]:
        """Return time constants in s by the parameter that makes them: where it is 0, a state is `algebraic`."""
        return {}

    @classmethod
    def channels(cls, values: Mapping[str, float]) -> dict[str, str]:
        """Return the quantities that a sensor can be on, with units: states, outputs, an optional position too."""
        return {**cls.states(values), cls.position: cls.position_unit, **cls.outputs, **cls.algebraic(values)}

    @classmethod
    def aliases(cls) -> dict[str, str]:
        """Return the signals that are position, velocity and effort; empty: none."""
        return {"position": cls.position, "velocity": cls.velocity, "effort": cls.effort}

    @classmethod
    def moved(cls, values: Mapping[str, float]) -> float:
        """Return the moving mass or inertia; ``values`` are the plant's parameters."""
        return float(values[cls.inertia_parameter])

    @classmethod
    def driven(cls, m: Any, values: Mapping[str, float], q: Any, acceleration: Any) -> Any:
        """Return the force (T,) that a motion q (T,) takes without effects, for a plant in a closed loop."""
        raise NotImplementedError

    @classmethod
    def unrecorded(cls, values: Mapping[str, float]) -> dict[str, float]:
        """Return default values of optional inputs, in SI units; ``values`` are the plant's parameters."""
        return dict.fromkeys(cls.optional_inputs, 0.0)

    @classmethod
    def free_speed(cls, values: Mapping[str, float]) -> float | None:
        """Return the speed that the motor reaches without a load, in SI units; None where that is not known."""
        return None

    def rates(self, m: Any, x: Any, u: Any, p: Any, act: Acting) -> dict[str, Any]:
        """Return the derivative of every state of the plant and the value of every output, by name."""
        raise NotImplementedError

    @classmethod
    def summary(cls) -> str:
        """Return the first line of the docstring."""
        return (cls.__doc__ or "").strip().splitlines()[0]
