"""What the linearizer does, without ROS: take states and inputs, refuse bad ones, give one model per period.

Time is a whole number of nanoseconds of one clock, and is passed in.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import InputError
from signlin_ros.estimate import StateEstimator
from signlin_ros.model import Model
from signlin_ros.nodes.channels import Channels
from signlin_ros.nodes.prepared import AT_START, Prepared
from signlin_ros.nodes.told import ERROR, LEVEL_OK, NANO, WARN, Health, Refusal, Update
from signlin_ros.observe import KalmanObserver
from signlin_ros.sensors import Sensor

Array = NDArray[np.float64]
OBSERVERS = ("kalman", "none")
"""Where states that are not measured come from: the model, corrected by what is measured; or a parabola and the model
alone."""
MOST_LATE = 10
"""Periods that are made up for when the node was late itself; more were a jump of the clock."""


@dataclass(frozen=True)
class _State:
    """The newest good state: x (n,), its stamp, and when it came, in ns; x is None where the observer has it."""

    x: Array | None
    stamp: int
    came: int


class LinearizerLogic:
    """States and inputs in, models out.

    Parameters
    ----------
    model : what is linearized.
    now : the time in ns; periods are counted from here.
    state_timeout : s without a valid state after which nothing is published; 0: three update periods.
    observer : one of `OBSERVERS`, for states that are not measured, and against the noise of those that are.
    input_timeout : s without an input after which none is known; 0: three update periods.
    ignored : channels that are left out, apart by commas (see `Channels`).

    While no input is known, the operating point is the state itself, whatever the model says: half a period ahead of
    it is not known. Diagnostics say so.
    """

    def __init__(
        self,
        model: Model,
        now: int,
        state_timeout: float = 0.0,
        observer: str = "kalman",
        input_timeout: float = 0.0,
        ignored: str = "",
    ) -> None:
        self.observer, self.model = observer, model
        self.channels, self._ignored = Channels(model, ignored), ignored
        self._state: _State | None = None
        self._watcher: KalmanObserver | None = None
        self._estimator: StateEstimator | None = None
        self._measuring = False
        self.refused: Counter[str] = Counter()
        self.faults: Counter[str] = Counter()
        self.accepted = 0
        self.sequence = 0
        self.last_refusal: Refusal | None = None
        self.last: Update | None = None
        self._latency = 0
        self._input_came: int | None = None
        self.state_timeout, self.input_timeout = state_timeout, input_timeout
        self.u = model.u0
        self.configure(model)
        self.reset(now)

    # ---------------------------------------------------------------- configuration

    def prepare(self, model: Model) -> Prepared:
        """Make all that another model needs, so that `configure` takes no time; may raise `InputError`."""
        if self._measuring:
            self.warm_up(model)
        watcher = self._watcher
        kept = [name for name in watcher.channels if name in model.states] if watcher is not None else []
        return Prepared.of(model, KalmanObserver(model, kept) if kept else None)

    def warm_up(self, model: Model) -> None:
        """Have compiled what a state that is not whole will need, so that the first message is as quick as others."""
        position = model.plant.position
        if self.observer == "kalman":
            shown = [name for name in (position, model.plant.velocity) if name in model.states][:1]
            observer = KalmanObserver(model, shown)
            for k in range(3):
                observer.take(1e-3 * k, dict.fromkeys(shown, 0.0))
            observer.estimate()
        elif position in model.states:
            StateEstimator(model, [position]).warm_up()
        self._measuring = True

    def configure(self, model: Model | Prepared) -> None:
        """Take another model at once, of whatever states; may raise `InputError`, and then nothing has changed.

        What is known goes on where the two have it in common: states that the observer has, the input, the sequence.
        """
        new = self.prepare(model) if isinstance(model, Model) else model
        before, self.model, self.linearizer, self._at_start = self.model, new.model, new.linearizer, new.at_start
        if new.observer is not None and self._watcher is not None:
            new.observer.adopt(self._watcher)
        self._watcher, self._estimator = new.observer, None
        self.period = round(self.model.update_period * NANO)
        self._perfect = all(sensor == Sensor() for sensor in self.model.sensors.values())
        if before.states != self.model.states:
            self.channels = Channels(self.model, self._ignored)
        if before.inputs != self.model.inputs:
            known = dict(zip(before.inputs, self.u.tolist(), strict=True))
            pairs = zip(self.model.inputs, self.model.u0.tolist(), strict=True)
            self.u = np.array([known.get(name, rest) for name, rest in pairs])
        if before.states != self.model.states and self._state is not None:
            self._state = self._state if self._watcher is not None and self._state.x is None else None

    def reset(self, now: int) -> None:
        """Forget the state and count periods from ``now``: the clock has jumped."""
        self._state = None
        self._estimator = None
        self._watcher, self._input_came = None, None
        self._fault, self._epoch = "", now
        self.restart(now)

    def restart(self, now: int) -> None:
        """Count periods from ``now``."""
        self.origin = now
        self._periods = 0
        self._recent: list[int] = []

    @property
    def timeout(self) -> int:
        """Age in ns above which a state is not used."""
        return round(self.state_timeout * NANO) if self.state_timeout > 0 else 3 * self.period

    @property
    def input_received(self) -> bool:
        """Whether an input has come."""
        return self._input_came is not None

    def unknown_input(self, now: int) -> str:
        """Return why no input is known at a time in ns; empty where one is."""
        if not self.model.inputs:
            return ""
        if self._input_came is None:
            return "no input has come"
        age = now - self._input_came
        longest = round(self.input_timeout * NANO) if self.input_timeout > 0 else 3 * self.period
        return f"the last input is {age / NANO:.3g} s old" if age > longest else ""

    # ---------------------------------------------------------------- input

    def take_input(self, value: Array | Refusal, now: int) -> None:
        """Hold an input (m,) that came at a time in ns until the next one, or until it is too old."""
        if isinstance(value, Refusal):
            self._refuse(Refusal(f"input_{value.kind}", value.detail))
            return
        self.u, self._input_came = value, now
        if self._watcher is not None:
            self._watcher.take_input((now - self._epoch) / NANO, value)

    def take_state(self, value: Array | Refusal, now: int) -> None:
        """Take a whole state (n,) as the sensors show it; it has no stamp of its own and gets the time it came."""
        if isinstance(value, Refusal):
            self._refuse(value)
            return
        shown = dict(zip(self.model.states, value.tolist(), strict=True))
        if len(self.channels.told(shown)) < len(shown):
            self.take_measured(shown, now, now)
        else:
            self._accept(value if self._perfect else self.model.true_states(value), now, now)

    def take_measured(self, value: Mapping[str, float] | Refusal, stamp: int, now: int) -> None:
        """Take what the sensors show of a state, by name, with its own stamp; the model carries the rest.

        Refused: a stamp older than the timeout, ahead of the clock by more than that, repeated, or out of
        order; a position that is missing, or a velocity where there is none.
        """
        if isinstance(value, Refusal):
            self._refuse(value)
            return
        value = self.channels.told(value)
        fault = self._stamp_fault(stamp, now) or self._missing(value)
        if fault is not None:
            self._refuse(fault)
            return
        try:
            x = self._whole(value, stamp)
        except InputError as error:  # the carried states ran away
            self._estimator = None
            self._refuse(Refusal("no_estimate", str(error)))
            return
        self._accept(x, stamp, now)

    def _refuse(self, refusal: Refusal) -> None:
        self.refused[refusal.kind] += 1
        self.faults[refusal.joint] += bool(refusal.joint)
        self.last_refusal = refusal

    def _accept(self, x: Array | None, stamp: int, now: int) -> None:
        if self._state is None:  # periods that passed without a state are not made up for
            self._periods = max(self._periods, (now - self.origin) // self.period)
        self._state = _State(x, stamp, now)
        self.accepted += 1

    def _stamp_fault(self, stamp: int, now: int) -> Refusal | None:
        age = now - stamp
        if age > self.timeout:
            hint = "; is header.stamp filled in?" if stamp == 0 else ""
            return Refusal("stale", f"stamp is {age / NANO:.3g} s old{hint}")
        if age < -self.timeout:
            return Refusal("future", f"stamp is {-age / NANO:.3g} s ahead of the clock")
        last = None if self._state is None else self._state.stamp
        if last is not None and stamp <= last:
            kind = "repeated" if stamp == last else "out_of_order"
            return Refusal(kind, f"stamp is {(last - stamp) / NANO:.3g} s before the last one")
        return None

    def _missing(self, measured: Mapping[str, float]) -> Refusal | None:
        """Position is needed where it is a state, else velocity; a velocity can be derived from positions."""
        states, position = self.model.states, self.model.plant.position
        needed = position if position in states else self.model.plant.velocity
        if needed in states and needed not in measured:
            return Refusal("missing", f"no {needed} in the message")
        return None

    def _whole(self, shown: Mapping[str, float], stamp: int) -> Array | None:
        """Return the state (n,) from what the sensors show of it; None where the observer has to be asked for it.

        That weighs what is measured by its noise, also where all is measured: a noisy velocity must not make a model
        worse than the position alone would. An arm has no observer.
        """
        states, sensors = self.model.states, self.model.sensors
        observed = self.observer == "kalman" and self.model.plant.name != "arm"
        if not observed and all(name in shown for name in states):
            return np.array([sensors[name].true(shown[name]) for name in states])
        resumed = self._state is None or stamp - self._state.stamp > self.timeout
        if self.observer == "kalman":
            self._watch(shown, stamp, resumed)
            return None
        known = tuple(name for name in states if name in shown)
        if self._estimator is None or resumed or self._estimator.measured != known:
            self._estimator = StateEstimator(self.model, known)
        true = {name: sensors[name].true(shown[name]) for name in known}
        return self._estimator.update((stamp - self._epoch) / NANO, true, self.u)

    def _watch(self, shown: Mapping[str, float], stamp: int, resumed: bool) -> None:
        """Hand a sample to the observer; the first of a run, or a new kind of one, starts it anew."""
        known = [name for name in self.model.states if name in shown]
        t = (stamp - self._epoch) / NANO
        if self._watcher is None or not set(known) <= set(self._watcher.channels):
            self._watcher = KalmanObserver(self.model, known)
            self._watcher.take_input(t, self.u)
        elif resumed:
            self._watcher.reset()
            self._watcher.take_input(t, self.u)
        self._watcher.take(t, shown)

    def _known_state(self, state: _State) -> Array:
        """Return the state (n,), asked of the observer if need be; may raise `InputError`."""
        if state.x is not None:
            return state.x
        if self._watcher is None:
            raise InputError("no state")
        x: Array = self._watcher.estimate().x
        return x

    # ---------------------------------------------------------------- output

    def updates(self, now: int) -> list[Update]:
        """Return the models that have fallen due by ``now``: one per period, none without a fresh state.

        Periods are counted, so that none is lost or doubled where a fast simulated clock, or a busy machine, calls
        late. A period that passed without a fresh state while this was called in time is gone.
        """
        first, self._periods = self._periods + 1, max(self._periods, (now - self.origin) // self.period)
        state = self._state
        if state is None or self._periods < first:
            return []
        late = max(self.timeout, MOST_LATE * self.period)
        oldest = -((self.origin - state.stamp + late) // self.period)
        newest = (state.stamp + self.timeout - self.origin) // self.period
        due = min(self._periods, newest) - max(first, oldest) + 1
        return self._results(state, due, now) if due > 0 else []

    def _results(self, state: _State, due: int, now: int) -> list[Update]:
        at = self._at_start if self.unknown_input(now) else self.linearizer
        try:
            result = at(self._known_state(state), self.u)
        except InputError as error:
            return self._no_result(str(error))
        if not all(np.isfinite(part).all() for part in (result.A, result.B, result.c, result.x, result.u)):
            return self._no_result("the matrices at this state are not finite")
        made = [Update(state.stamp, self.sequence + i, result) for i in range(due)]
        self.sequence += due
        self._fault = ""
        self.last, self._latency = made[-1], now - state.came
        self._recent = [*self._recent[-20:], *[now] * due]
        return made

    def _no_result(self, why: str) -> list[Update]:
        self._refuse(Refusal("no_result", why))
        self._fault = why
        self._state = self._watcher = None
        return []

    # ---------------------------------------------------------------- diagnostics

    def health(self, now: int) -> Health:
        """Return the state of affairs for /diagnostics."""
        age = now - (self.origin if self._state is None else self._state.stamp)
        level, message = self._verdict(age, now)
        unknown = self.unknown_input(now)
        values = {
            "plant": self.model.plant.name,
            "sequence": str(self.sequence),
            "rate [Hz]": f"{self.rate(now):.3f}",
            "state age [s]": "no state" if self._state is None else f"{age / NANO:.6f}",
            "latency from state to model [s]": "unknown" if self.last is None else f"{self._latency / NANO:.6f}",
            "states accepted": str(self.accepted),
            "messages refused": str(sum(self.refused.values())),
            "input received": str(self.input_received).lower(),
            "input age [s]": "no input" if self._input_came is None else f"{(now - self._input_came) / NANO:.6f}",
            "operating point": f"{AT_START}: {unknown}" if unknown else self.model.operating_point,
            "in_valid_range": "unknown" if self.last is None else str(self.last.result.in_valid_range).lower(),
            "delay [s]": "unknown" if self.last is None else f"{self.last.result.delay:g}",
        }
        if self.last is not None:
            values["age of the last model [s]"] = f"{(now - self.last.stamp) / NANO:.6f}"
        if self._watcher is not None:
            noise = (f"{name} {sigma:.3g}" for name, sigma in self._watcher.sigma.items())
            values["observer"] = f"kalman, model trusted to {100 * self._watcher.trust:g} %; noise: {', '.join(noise)}"
        if self.channels.sentence:
            values["channels"] = self.channels.sentence
        if self.last_refusal is not None:
            values["last refused"] = f"{self.last_refusal.kind}: {self.last_refusal.detail}"
        values |= {f"refused: {k}": str(n) for k, n in sorted(self.refused.items())}
        return Health(level, message, values | self._joints())

    def _joints(self) -> dict[str, str]:
        """Return of every joint of an arm whether its sign_j is in their valid range, and messages refused for it."""
        if self.model.plant.name != "arm" or self.last is None:
            return {f"{joint}: messages refused": str(n) for joint, n in sorted(self.faults.items()) if joint}
        from signlin_ros.nodes.joints import outside

        beyond = outside(self.model, self.last.result.x, self.last.result.u)
        names = [name.removesuffix(".effort") for name in self.model.inputs]
        found = {f"{name}: in_valid_range": str(name not in beyond).lower() for name in names}
        return found | {f"{name}: messages refused": str(self.faults[name]) for name in names}

    def _verdict(self, age: int, now: int) -> tuple[int, str]:
        if age > self.timeout:
            what = "no valid state yet" if self.last is None else "no valid state; the last model stays"
            return ERROR, f"{what} ({age / NANO:.3g} s)"
        if self._fault:
            return ERROR, f"no model: {self._fault}"
        if self._state is None:
            return WARN, "waiting for the first state"
        doubts = []
        if self.last is not None and not self.last.result.in_valid_range:
            doubts.append("outside the valid range of sign_j: friction is under- or overestimated")
        if unknown := self.unknown_input(now):
            held = " and ".join(f"{v:g}" for v in self.u)
            doubts.append(f"{unknown}: linearized at the state itself, with an input of {held}")
        if self.channels.dead:
            doubts.append(self.channels.sentence)
        return (WARN, "; ".join(doubts)) if doubts else (LEVEL_OK, "publishing")

    def rate(self, now: int) -> float:
        """Return how many models were made per second lately, over the last 20 at most."""
        if len(self._recent) < 2 or now - self._recent[-1] > self.timeout:
            return 0.0
        span = (self._recent[-1] - self._recent[0]) / NANO
        return (len(self._recent) - 1) / span if span > 0 else 0.0


__all__ = [
    "ERROR",
    "LEVEL_OK",
    "MOST_LATE",
    "NANO",
    "OBSERVERS",
    "WARN",
    "Health",
    "LinearizerLogic",
    "Refusal",
    "Update",
]
