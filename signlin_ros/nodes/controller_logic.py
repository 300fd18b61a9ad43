"""What the controller node does, without ROS: references, states and models in, one input per period out.

Time is a whole number of nanoseconds of one clock, and is passed in. Whatever is missing, stale or bad stops the drive:
the input is 0 from the next period on. It goes on from where the drive is, with an approach to the reference
(`signlin_ros.control.approach`). After a fault of the loop itself (`signlin_ros.control.supervision`) it goes on only
when it is asked to.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.control.approach import Approach
from signlin_ros.control.controller import Controller, ControllerSettings
from signlin_ros.control.prediction import DrivePrediction
from signlin_ros.control.supervision import SpeedNoise, Supervisor
from signlin_ros.errors import InputError
from signlin_ros.estimate import CausalDerivative
from signlin_ros.model import Model
from signlin_ros.nodes.channels import Channels
from signlin_ros.nodes.loop_times import LoopTimes
from signlin_ros.nodes.told import ERROR, LEVEL_OK, NANO, WARN, Health, Refusal

Array = NDArray[np.float64]
LONGEST_REFERENCE = 3
"""Values of a reference at most: what is tracked, its rate, and the rate of that."""
GOES_ON = 2
"""Periods for which a reference goes on as it was."""
OLD_MODEL = 2.0
"""Update periods after which a linear model is told to be old."""
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
    asks : whether it waits to be asked (`resume`) after whatever was missing or stale, too.
    ignored : channels that are left out, apart by commas; of a joint, one that is 0 throughout is, too (`Channels`).
    """

    def __init__(
        self,
        model: Model,
        settings: ControllerSettings,
        timeouts: Timeouts | None = None,
        needs_model: bool = True,
        asks: bool = False,
        ignored: str = "",
    ) -> None:
        self.refused: Counter[str] = Counter()
        self.last_refusal: Refusal | None = None
        self.stops = 0
        self.timeouts, self.needs_model, self.asks = timeouts or Timeouts(), needs_model, asks
        self.fault = self.last_stop = ""
        self._noise = SpeedNoise()
        self.measured, self.channels = model.states, Channels(model, ignored)
        self.configure(model, settings)
        self.reset()

    # ---------------------------------------------------------------- configuration

    def configure(self, model: Model, settings: ControllerSettings) -> None:
        """Take another model or other settings; may raise `InputError`, and then nothing has changed."""
        self.use(Controller(model, settings))
        self._announced = model

    def use(self, controller: Controller) -> None:
        """Take another controller, whose gains are made; the drive goes on from where it is."""
        self.controller, self.model, self.settings = controller, controller.model, controller.settings
        self._ages = self.timeouts.in_ns(self.settings.period, self.model.update_period)
        settings = controller.settings
        self.prediction = DrivePrediction(controller.constants)
        self.supervisor = Supervisor(
            controller.task, controller.bandwidth, settings.floor, settings.runaway, self._noise
        )
        self._running = False

    def reset(self) -> None:
        """Forget all, but for a fault: the clock has jumped."""
        self._got: dict[str, _Got] = {}
        self._derivative = CausalDerivative()
        self._running = False
        self._why, self._before, self._used = "waiting", 0, 0
        self._approach: Approach | None = None
        self._astray, self._held_up = "", -(10**18)
        self._begun = 0
        self.active = False
        self.u = 0.0
        self.times = LoopTimes(self.settings.period, self.controller.task.delay)

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
        before = self._got.get("reference")
        if self._running and before is not None and self._jumps(before, motion, now):
            if given.size == 1:
                motion[place + 1] = 0.0
            self._come_from(self._wanted(before, now), motion, now)
        self._got["reference"] = _Got(motion, now)

    def _jumps(self, before: _Got, motion: Array, now: int) -> bool:
        """Tell whether a reference is not where it can have come to: the drive cannot do it, nor what it asks for."""
        reach, span = self.controller.reach, max(now - before.when, 1) / NANO
        place = 0 if self.settings.position else 1
        most = (2.0 * reach.speed, 2.0 * reach.acceleration)[place]
        return bool(abs(motion[place] - before.values[place]) > most * max(span, self.settings.period))

    def _come_from(self, motion: Array, reference: Array, now: int) -> None:
        """Approach a reference (3,) from a motion (3,)."""
        self._approach = Approach.begin(motion[:2] - reference[:2], self.controller.reach, self.settings.position)
        self._begun = now

    def _rate(self, value: float, place: int, now: int) -> float:
        before = self._got.get("reference")
        age = 0 if before is None else now - before.when
        if before is None or not 0 < age <= self._ages["reference"]:
            return 0.0
        return (value - float(before.values[place])) / (age / NANO)

    def take_state(self, value: Array | Refusal, now: int) -> None:
        """Take a state as the sensors show it, in the order of ``measured``: the states of the model at the start.

        ``now`` is when it was sent, where that is known, else when it came; one that was sent before the last one is
        refused. A model that comes later may have states of its own that nobody measures.
        """
        if isinstance(value, Refusal):
            self._refuse(value)
            return
        before = self._got.get("state")
        if before is not None and now < before.when:
            self._refuse(Refusal("out_of_order", f"sent {(before.when - now) / NANO:.3g} s before the last one"))
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
        shown = self.channels.told({name: joint[field] for field, name in named if field in joint})
        return {name: self._without_sensor(name, value) for name, value in shown.items()}

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
        self._noise.take(float(found.get(velocity, 0.0)))

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
            self.use(controller)

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
        self._look_at_time(now)
        was_running, self._before = self._running, now
        self._why = self.fault or self._missing(now)
        u = 0.0 if self._why else self._controlled(now)
        if not math.isfinite(u):
            self._why = "the design gives no finite input"
        self._why = self.fault or self._astray or self._why
        self._astray = ""
        self._running = not self._why
        if was_running and self._why:
            self.stops, self.last_stop = self.stops + 1, self._why
            if self.asks:
                self.fault = self._why
        self.active = self.active or self._running
        self.u = u if self._running else 0.0
        self.prediction.take(now, self.u)
        return np.array([self.u]) if self.active else None

    @property
    def stopped(self) -> bool:
        """Whether the drive has run, and is stopped now."""
        return self.active and not self._running

    def resume(self) -> str:
        """Go on after a fault; return what was wrong, empty where nothing was."""
        was, self.fault = self.fault, ""
        return was

    def _look_at_time(self, now: int) -> None:
        """Count inputs that are late; after so long a pause that a state would be too old the loop begins anew."""
        pause = now - self._before if self._before else 0
        if self.times.take_pause(pause):
            self._held_up = now
        if self._running and pause > self._ages["state"]:
            self.stops, self.last_stop = self.stops + 1, f"no input for {pause / NANO:.3g} s: this node was held up"
            self._running = False

    def _missing(self, now: int) -> str:
        """Return what is missing, so that the drive has to stop; empty where nothing is."""
        for name in ("reference", "state", *(("model",) if self.needs_model else ())):
            got = self._got.get(name)
            if got is None:
                return f"no {name} yet"
            age = now - got.when
            if not -self._ages[name] <= age <= self._ages[name]:
                return f"the {name} is {age / NANO:.3g} s old"
        measured = self._got["state"].values
        if not self._running and not self.supervisor.may_begin(self._got["reference"].values, measured):
            return f"the drive is faster than its reference: {measured[1]:.3g}; waiting until it is not"
        return ""

    def _controlled(self, now: int) -> float:
        """Return the input of the controller; note a fault of the loop."""
        reference, state = self._got["reference"], self._got["state"]
        if not self._running:
            self._begin(reference, state, now)
        then, ahead = self._wanted(reference, state.when), self._wanted(reference, now)
        oldest = now - round(self.controller.task.delay * NANO)
        if state.when < oldest:  # the gains are made for what is not older: where is it by then?
            self._held_up = now
            seen = self.prediction.at(state.values, state.when, oldest)
            u = self.controller.step(self._wanted(reference, oldest), seen, ahead)
        else:
            u = self.controller.step(then, state.values, ahead)
        fresh, self._used = state.when != self._used, state.when
        self.times.take_age(now - state.when)
        sent = float(reference.values[1])
        fault = self.supervisor.take(then, sent, state.values, u, self.controller.foretold, fresh)
        if fault and now - self._held_up <= self.supervisor.window * self.settings.period * NANO:
            self._astray = f"{fault}, after this node or its states were held up"
        else:
            self.fault = fault
        return u

    def _begin(self, reference: _Got, state: _Got, now: int) -> None:
        """Begin where the drive is: no integral action, and a reference that starts from what is measured."""
        self.controller.reset(state.values)
        self.supervisor.reset()
        self._approach = None
        self._come_from(state.values, self._wanted(reference, now), now)

    def _wanted(self, reference: _Got, when: int) -> Array:
        """Return the reference (3,) at a time near that of its message, with what is left of the way to it.

        It goes on, or came, as it is at the time of the message.
        """
        most = GOES_ON * self.settings.period
        age = min(max((when - reference.when) / NANO, -most), most)
        q, v, a = reference.values
        motion = np.array([q + v * age + a * age**2 / 2, v + a * age, a])
        if self._approach is not None:
            motion += self._approach.at((when - self._begun) / NANO)
        return motion

    # ---------------------------------------------------------------- diagnostics

    def health(self, now: int) -> Health:
        """Return the state of affairs for /diagnostics."""
        level, message = self._level(now)
        wrong, own = self.supervisor.errors
        ages = {f"age of the {name} [s]": f"{(now - got.when) / NANO:.6f}" for name, got in self._got.items()}
        values = {
            "design": self.settings.design,
            "bandwidth [rad/s]": f"{self.controller.bandwidth:.4g}",
            "tracks": "position" if self.settings.position else "speed",
            "input": f"{self.u:.6g}",
            "RMS error": f"{wrong:.4g}",
            "RMS error foretold": f"{own:.4g}",
            "share of time at the limit": f"{self.supervisor.saturation:.3g}",
            "stops": str(self.stops),
            "last stop": self.last_stop or "none",
            "late inputs": str(self.times.late),
            "oldest state used [s]": f"{self.times.oldest / NANO:.6f}",
            "messages refused": str(sum(self.refused.values())),
        }
        if self.last_refusal is not None:
            ages["last refused"] = f"{self.last_refusal.kind}: {self.last_refusal.detail}"
        return Health(
            level, message, values | ages | {f"refused: {k}": str(n) for k, n in sorted(self.refused.items())}
        )

    def _level(self, now: int) -> tuple[int, str]:
        if self.fault:
            return ERROR, f"stopped: {self.fault}; it goes on when it is asked to (~/resume)"
        if not self._running:
            return (ERROR if self.active else WARN), f"stopped: {self._why}"
        model = self._got.get("model") if self.needs_model else None
        age = 0.0 if model is None else (now - model.when) / NANO
        old = f"the linear model is {age:.3g} s old" if age > OLD_MODEL * self.model.update_period else ""
        warning = self.supervisor.warning or self.times.warning or old
        return (WARN, f"tracking, but {warning}") if warning else (LEVEL_OK, "tracking")


def _is_of(values: Array, n: int, m: int) -> bool:
    """Tell whether a message of the linearizer is of a model of n states and m inputs."""
    return values.size == MODEL_HEAD + n * n + n * m + 2 * n + m and (values[4], values[5]) == (n, m)
