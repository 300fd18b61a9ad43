"""What the controller node does, without ROS: references, states and models in, one input per period out.

Time is a whole number of nanoseconds of one clock, and is passed in. Whatever is missing, stale or bad stops the drive:
the input is 0 from the next period on, until all is well again.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control.controller import Controller, ControllerSettings
from signlin_ros.errors import InputError
from signlin_ros.estimate import CausalDerivative
from signlin_ros.model import Model
from signlin_ros.nodes.linearizer_logic import ERROR, LEVEL_OK, NANO, WARN, Health, Refusal

Array = NDArray[np.float64]
LONGEST_REFERENCE = 3
"""Values of a reference at most: what is tracked, its rate, and the rate of that."""
GOES_ON = 2
"""Periods for which a reference goes on as it was."""
LATE_PERIODS = 2
"""Periods between two inputs from which on the later one counts as late."""
MODEL_HEAD = 6
"""Numbers before the matrices in a message of the linearizer."""


@dataclass(frozen=True)
class Timeouts:
    """Ages in s above which what was received is not used; 0: three control periods, 0.5 s, three update periods."""

    state: float = 0.0
    reference: float = 0.0
    model: float = 0.0

    def in_ns(self, control_period: float, update_period: float) -> dict[str, int]:
        """Return the ages in ns."""
        defaults = {"state": 3 * control_period, "reference": 0.5, "model": 3 * update_period}
        return {name: round((getattr(self, name) or default) * NANO) for name, default in defaults.items()}


@dataclass(frozen=True)
class _Got:
    """Values and when they were true, in ns."""

    values: Array
    when: int


class ControllerLogic:
    """References, states and models in, inputs out.

    Parameters
    ----------
    model, settings : what is controlled, and how.
    timeouts : ages that stop the drive.
    needs_model : whether a linearizer must be publishing.
    """

    def __init__(
        self, model: Model, settings: ControllerSettings, timeouts: Timeouts | None = None, needs_model: bool = True
    ) -> None:
        self.refused: Counter[str] = Counter()
        self.last_refusal: Refusal | None = None
        self.late = 0
        self.timeouts, self.needs_model = timeouts or Timeouts(), needs_model
        self.measured = model.states
        self.configure(model, settings)
        self.reset()

    # ---------------------------------------------------------------- configuration

    def configure(self, model: Model, settings: ControllerSettings) -> None:
        """Take another model or other settings; may raise `InputError`, and then nothing has changed."""
        self._use(Controller(model, settings))
        self._announced = model

    def _use(self, controller: Controller) -> None:
        self.controller, self.model, self.settings = controller, controller.model, controller.settings
        self._ages = self.timeouts.in_ns(self.settings.period, self.model.update_period)
        self._running = False

    def reset(self) -> None:
        """Forget all: the clock has jumped."""
        self._got: dict[str, _Got] = {}
        self._derivative = CausalDerivative()
        self._running = False
        self._why, self._before = "waiting", 0
        self.active = False
        self.u = 0.0

    # ---------------------------------------------------------------- input

    def take_reference(self, value: Array | Refusal, now: int) -> None:
        """Take a reference (1 to 3,): what is tracked, its rate, the rate of that; a missing first rate is derived."""
        if isinstance(value, Refusal):
            self._refuse(Refusal(f"reference_{value.kind}", value.detail))
            return
        motion = np.zeros(3)
        place = 0 if self.settings.position else 1
        given = value[: 3 - place]
        motion[place : place + given.size] = given
        if given.size == 1:
            motion[place + 1] = self._rate(float(given[0]), place, now)
        self._got["reference"] = _Got(motion, now)

    def _rate(self, value: float, place: int, now: int) -> float:
        before = self._got.get("reference")
        age = 0 if before is None else now - before.when
        if before is None or not 0 < age <= self._ages["reference"]:
            return 0.0
        return (value - float(before.values[place])) / (age / NANO)

    def take_state(self, value: Array | Refusal, now: int) -> None:
        """Take a state as the sensors show it, in the order of ``measured``: the states of the model at the start.

        A model that comes later may have states of its own that nobody measures.
        """
        if isinstance(value, Refusal):
            self._refuse(value)
            return
        shown = dict(zip(self.measured, value.tolist(), strict=True))
        self._take({name: self._without_sensor(name, shown[name]) for name in self._names if name in shown}, now, now)

    def take_measured(self, value: Mapping[str, float] | Refusal, stamp: int, now: int) -> None:
        """Take what the sensors show of a joint by name, ``position`` and ``velocity``, with its own stamp."""
        if isinstance(value, Refusal):
            self._refuse(value)
            return
        age = now - stamp
        before = self._got.get("state")
        if abs(age) > self._ages["state"]:
            self._refuse(Refusal("stale" if age > 0 else "future", f"stamp is {age / NANO:.3g} s old"))
        elif before is not None and stamp <= before.when:
            self._refuse(Refusal("out_of_order", f"stamp is {(before.when - stamp) / NANO:.3g} s before the last one"))
        else:
            self._take(self._true(value), stamp, now)

    @property
    def _names(self) -> tuple[str, str]:
        return self.model.plant.position, self.model.plant.velocity

    def _true(self, joint: Mapping[str, float]) -> dict[str, float]:
        """Return position and speed by the model's names, without what its sensors add."""
        named = zip(("position", "velocity"), self._names, strict=True)
        return {name: self._without_sensor(name, joint[field]) for field, name in named if field in joint}

    def _without_sensor(self, name: str, shown: float) -> float:
        sensors = self.model.sensors
        return float(sensors[name].true(shown)) if name in sensors else shown

    def _take(self, found: Mapping[str, float], stamp: int, now: int) -> None:
        position, velocity = self._names
        if velocity not in found and position in found:
            found = {**found, velocity: self._derived(found[position], stamp)}
        needed = position if self.settings.position else velocity
        if needed not in found:
            self._refuse(Refusal("missing", f"no {needed} in the message"))
            return
        self._got["state"] = _Got(np.array([found.get(position, 0.0), found.get(velocity, 0.0)]), stamp)

    def _derived(self, position: float, stamp: int) -> float:
        before = self._got.get("state")
        if before is None or stamp - before.when > self._ages["state"]:
            self._derivative.reset()
        try:
            return self._derivative.update(stamp / NANO, position)
        except InputError:  # the same moment again
            self._derivative.reset()
            return self._derivative.update(stamp / NANO, position)

    def take_model(self, data: Sequence[float]) -> None:
        """Take a message of the linearizer: fresh ones keep the drive running, one of another model is refused."""
        values = np.asarray(data, dtype=float)
        sizes = [(len(model.states), len(model.inputs)) for model in (self.model, self._announced)]
        if values.size < MODEL_HEAD or not np.isfinite(values).all():
            self._refuse(Refusal("model_not_finite", f"{values.size} values"))
        elif not any(_is_of(values, n, m) for n, m in sizes):
            n, m = sizes[0]
            self._refuse(Refusal("another_model", f"{values.size} values, not those of {n} states and {m} inputs"))
        else:
            self._got["model"] = _Got(values[MODEL_HEAD:], int(values[0]) * NANO + int(values[1]))

    def announce(self, text: str) -> Model | None:
        """Take notice of the whole model that the linearizer has; returns it where it is another one.

        What the linearizer publishes of it counts from now on, while `prepared` and `take_prepared` bring it into use.
        """
        try:
            model = Model.from_yaml(text, "linearizer/model_yaml", self.model.folder)
        except InputError as error:
            self._refuse(Refusal("model_yaml", str(error)))
            return None
        self._announced = model
        return None if model.to_dict() == self.model.to_dict() else model

    def prepared(self, model: Model) -> Controller | InputError:
        """Return the design and feed-forward of a model, or why there is none; changes nothing, may take its time."""
        try:
            return Controller(model, self.settings)
        except InputError as error:
            return error

    def take_prepared(self, controller: Controller | InputError) -> None:
        """Go on with another controller at once, or refuse it."""
        if isinstance(controller, InputError):
            self._announced = self.model
            self._refuse(Refusal("model_yaml", str(controller)))
        elif controller.settings != self.settings:  # they were changed meanwhile
            self.take_prepared(self.prepared(controller.model))
        else:
            self._use(controller)

    def take_yaml(self, text: str) -> None:
        """Take the whole model that the linearizer has: design and feed-forward are made anew, or it is refused."""
        model = self.announce(text)
        if model is not None:
            self.take_prepared(self.prepared(model))

    def _refuse(self, refusal: Refusal) -> None:
        self.refused[refusal.kind] += 1
        self.last_refusal = refusal

    # ---------------------------------------------------------------- output

    def output(self, now: int) -> Array | None:
        """Return the input (1,) to publish now; 0 while stopped; None until the drive has run for the first time."""
        if self._before and now - self._before > LATE_PERIODS * self.settings.period * NANO:
            self.late += 1
        self._before, self._why = now, self._fault(now)
        u = 0.0 if self._why else self._controlled(now)
        if not math.isfinite(u):
            self._why, u = "the design gives no finite input", 0.0
        self._running = not self._why
        self.active = self.active or self._running
        self.u = u
        return np.array([u]) if self.active else None

    def _fault(self, now: int) -> str:
        """Return why the drive has to stop; empty where it need not."""
        for name in ("reference", "state", *(("model",) if self.needs_model else ())):
            got = self._got.get(name)
            if got is None:
                return f"no {name} yet"
            age = now - got.when
            if not -self._ages[name] <= age <= self._ages[name]:
                return f"the {name} is {age / NANO:.3g} s old"
        return ""

    def _controlled(self, now: int) -> float:
        reference, state = self._got["reference"], self._got["state"]
        if not self._running:
            self.controller.reset(float(state.values[0]))
        feed = self._going_on(reference, now)
        return self.controller.step(self._going_on(reference, state.when), state.values, feed)

    def _going_on(self, reference: _Got, when: int) -> Array:
        """Return the reference (3,) at a time near that of its message: it goes on, or came, as it is now."""
        most = GOES_ON * self.settings.period
        age = min(max((when - reference.when) / NANO, -most), most)
        q, v, a = reference.values
        return np.array([q + v * age + a * age**2 / 2, v + a * age, a])

    # ---------------------------------------------------------------- diagnostics

    def health(self, now: int) -> Health:
        """Return the state of affairs for /diagnostics."""
        level = LEVEL_OK if self._running else (ERROR if self.active else WARN)
        values = {
            "design": self.settings.design,
            "tracks": "position" if self.settings.position else "speed",
            "input": f"{self.u:.6g}",
            "late inputs": str(self.late),
            "messages refused": str(sum(self.refused.values())),
        }
        for name, got in self._got.items():
            values[f"age of the {name} [s]"] = f"{(now - got.when) / NANO:.6f}"
        if self.last_refusal is not None:
            values["last refused"] = f"{self.last_refusal.kind}: {self.last_refusal.detail}"
        message = "tracking" if self._running else f"stopped: {self._why}"
        return Health(level, message, values | {f"refused: {k}": str(n) for k, n in sorted(self.refused.items())})


def _is_of(values: Array, n: int, m: int) -> bool:
    """Tell whether a message of the linearizer is of a model of n states and m inputs."""
    return values.size == MODEL_HEAD + n * n + n * m + 2 * n + m and (values[4], values[5]) == (n, m)
