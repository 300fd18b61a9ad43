"""A controller at work: a design made from a model, its feed-forward, and one step of both; no ROS in it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control import CONTROL_PERIOD
from signlin_ros.control.approach import Reach
from signlin_ros.control.constants import Constants
from signlin_ros.control.designs import DEFAULT_DESIGN, Design, Task, Tuning, default_tuning, find_design, known
from signlin_ros.control.drive import Drive, friction_free
from signlin_ros.control.foretell import ForetoldLoop
from signlin_ros.control.gains import largest_speed
from signlin_ros.control.holding import holding
from signlin_ros.control.inverse import MAX_STATE_STEP, InverseModel
from signlin_ros.control.law import RunningLaw
from signlin_ros.control.supervision import Foretold
from signlin_ros.errors import InputError
from signlin_ros.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ControllerSettings:
    """What a user says of a controller; 0 for delay, speed and bandwidth: chosen from the model.

    Units: period and delay in s, limit in the input's unit, speed and tolerance in the model's, bandwidth in rad/s.
    ``delay`` is the longest from a sample until its input acts; nobody knows it to the millisecond, so that the loop
    has to hold with every one from the model's own up to it. ``runaway``: share by which the drive may be faster than
    its reference.
    """

    limit: float
    design: str = DEFAULT_DESIGN
    position: bool = False
    period: float = CONTROL_PERIOD
    delay: float = 0.0
    speed: float = 0.0
    tolerance: float = 0.0
    bandwidth: float = 0.0
    damping: float = 1.0
    integral: float = 1.0
    floor: float = 0.02
    friction: float = 1.0
    turning: float = 1.0
    runaway: float = 0.5

    def __post_init__(self) -> None:
        if not 0.0 < self.limit < np.inf:
            raise InputError(f"limit: found {self.limit:g}; say the largest |input| that the drive may be given")

    def task(self, model: Model) -> Task:
        """Return the settings of a controller for a drive."""
        delay = self.delay or self.period + model.delay
        speed = self.speed or largest_speed(model)
        return Task(self.position, self.period, delay, self.limit, speed, self.tolerance, model.delay)

    def tuning(self, design: Design, model: Model, task: Task) -> Tuning:
        """Return the tuning asked for; raise `InputError` with the largest bandwidth that holds where it does not."""
        weights = replace(default_tuning(task.period, task.delay).weights, damping=self.damping, integral=self.integral)
        tuning = Tuning(weights, self.floor, self.friction, self.turning)
        return holding(design, model, task, tuning, self.bandwidth)


class FeedForward:
    """What a design feeds forward, step by step: the mean over the time in which the input acts.

    The reference goes on with the acceleration that it has; states of hysteresis and bristles go with it.
    """

    def __init__(self, design: Design, model: Model, task: Task, tuning: Tuning) -> None:
        self._share = {"none": 0.0, "linear": 0.0, "friction": tuning.friction}[design.feed]
        width = tuning.floor * task.speed
        wanted = {"none": [], "linear": [friction_free(model)], "friction": [friction_free(model), model]}[design.feed]
        self._models = [InverseModel(Drive.of(m, with_position=task.position), width) for m in wanted]
        parts = max(1, int(np.ceil(task.period / MAX_STATE_STEP)))
        self._h = task.period / parts
        self._ages = np.mean(task.delays) + self._h * (np.arange(parts) + 0.5)

    def reset(self, position: float) -> None:
        """Begin anew at rest at a position."""
        for one in self._models:
            one.reset(position)

    def __call__(self, q: float, v: float, a: float) -> float:
        """Return the input to hold next for a reference that is now at q with speed v and acceleration a."""
        t = self._ages
        motion = np.column_stack([q + v * t + a * t**2 / 2, v + a * t, np.full(t.size, a)])
        found = [one.mean(motion, self._h) for one in self._models]
        if not found:
            return 0.0
        return found[0] + self._share * (found[-1] - found[0])


class Controller:
    """A design at work on a model's drive; raises `InputError` where the model or a setting does not allow it."""

    def __init__(self, model: Model, settings: ControllerSettings) -> None:
        if len(model.inputs) != 1:
            raise InputError(f"{model.source}: a controller drives one input; the model has {', '.join(model.inputs)}")
        design = find_design(settings.design)
        self.model, self.settings, self.task = model, settings, settings.task(model)
        self.tuning = settings.tuning(design, model, self.task)
        self.law = design.law(model, self.task, self.tuning)
        self._running, self._ahead = RunningLaw(self.law), FeedForward(design, model, self.task, self.tuning)
        self._foretold = ForetoldLoop(model, self.task, self.law)
        self.reset(np.zeros(2))
        self.step(np.zeros(3), np.zeros(2))  # what is compiled is compiled before time counts
        self.reset(np.zeros(2))

    @property
    def bandwidth(self) -> float:
        """Bandwidth in rad/s that the gains are made for."""
        return self.tuning.weights.bandwidth

    @property
    def reach(self) -> Reach:
        """What a way back to the reference may ask of the drive."""
        return Reach.of(self.constants, self.task, self.bandwidth)

    @property
    def constants(self) -> Constants:
        """What the drive asks for, as constants."""
        return known(self.model, self.task)

    def reset(self, measured: Array) -> None:
        """Forget what has been: the drive has a position and a speed (2,)."""
        self._running.reset()
        self._ahead.reset(float(measured[0]))
        self._foretold.reset(measured)
        self.foretold: Foretold | None = None

    def step(self, reference: Array, measured: Array, now: Array | None = None) -> float:
        """Return the input for the next period, within the limit.

        reference : (3,) position, speed, acceleration at the time of what is measured; ``now``: those now, if later.
        measured : (2,) position, speed. Where the speed is tracked, a position that the model knows of is the measured
        one: waves stand where the drive is. ``foretold`` is then what simulation says of this period.
        """
        ahead = reference if now is None else now
        q = ahead[0] if self.settings.position else measured[0]
        feed = self._ahead(float(q), float(ahead[1]), float(ahead[2]))
        self.foretold = self._foretold.step(ahead, feed) if self._foretold.possible else None
        return self._running(np.ascontiguousarray(reference[:2]), np.ascontiguousarray(measured), feed)
