"""One trial: every design on one rig, tuned and then measured."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.controllers.plants import Rig, corner, mismatched
from benchmarks.controllers.search import ALWAYS, search
from signlin_ros.control.designs import DEFAULT_DESIGN, DESIGNS, Design, Task, Tuning, default_tuning, feed_along
from signlin_ros.control.drive import Drive
from signlin_ros.control.holding import holding
from signlin_ros.control.lqr import Weights
from signlin_ros.control.reference import Profile
from signlin_ros.control.tracking import TrackingBench, TrackingRun
from signlin_ros.errors import InputError
from signlin_ros.model import Model

MEASURED_ON = 4
"""Mismatched plants, drawn at random, that the table is measured on beside the nominal one."""
CHATTER = 0.02
"""Bound on chatter, as a share of the limit of the input; the search pays for what is beyond it."""
LONG_STOP, SETTLED = 30.0, 10.0
"""Seconds of a stop, and of its beginning that does not count, in which a drive is asked for a standing oscillation."""
RTOL = 1e-3
STOPS = "stops"
"""Word in the name of a reference that ends with a long one."""
AT_REST = 2.0
"""Last seconds of a stop, in which an oscillation counts."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A rig, what is tracked, how often, and the seed of noise, mismatch and search."""

    rig: Rig
    position: bool
    period: float
    seed: int

    @property
    def name(self) -> str:
        kind = "position" if self.position else "speed"
        return f"{self.rig.name}-{kind}-{round(1000 * self.period)}ms-{self.seed}"

    @property
    def task(self) -> Task:
        """One period, or 20 ms, of delay from a sample to its input."""
        delay = min(self.period, 0.02)
        tolerance = 5.0 * self.rig.noise[0] if self.position else 0.0
        return Task(self.position, self.period, delay, self.rig.limit, self.rig.speed, tolerance)

    def random(self, what: str) -> np.random.Generator:
        return np.random.default_rng([zlib.crc32(f"{self.name}:{what}".encode())])

    @property
    def tuned_on(self) -> list[Model]:
        """The nominal plant, and those that answer most and least to their input."""
        return [self.rig.model, corner(self.rig.model, 1.0), corner(self.rig.model, -1.0)]

    @property
    def measured_on(self) -> list[Model]:
        """The nominal plant, and others that no search has seen."""
        rng = self.random("table")
        return [self.rig.model, *(mismatched(self.rig.model, rng) for _ in range(MEASURED_ON))]


class Stand:
    """The benches of a trial: plants by references, with noise."""

    def __init__(
        self, trial: Trial, plants: Iterable[Model], what: str, profiles: Mapping[str, Profile] | None = None
    ) -> None:
        self.trial, self.profiles = trial, profiles or trial.rig.profiles(trial.position)
        self.benches = [
            {
                name: self._bench(Drive.of(plant, trial.position), profile, what)
                for name, profile in self.profiles.items()
            }
            for plant in plants
        ]

    def _bench(self, drive: Drive, profile: Profile, what: str) -> TrackingBench:
        count = TrackingBench(drive, profile, self.trial.period).count
        noise = self.trial.random(f"noise {what}").standard_normal((count, 2)) * np.array(self.trial.rig.noise)
        return TrackingBench(drive, profile, self.trial.period, self.trial.task.delay, noise)

    def runs(
        self, design: Design, model: Model, tuning: Tuning, task: Task | None = None
    ) -> list[dict[str, TrackingRun]]:
        """Return the runs of a design made from a model, by plant and reference; ``task``: what it believes."""
        task = task or self.trial.task
        law = design.law(model, task, tuning)
        found = []
        for by_name in self.benches:
            feeds = {n: feed_along(design, model, task, tuning, self.profiles[n], b.count) for n, b in by_name.items()}
            found.append({name: bench.run(law, feeds[name], RTOL) for name, bench in by_name.items()})
        return found


def cost(trial: Trial, runs: list[dict[str, TrackingRun]]) -> float:
    """Return the mean error over plants and references, each as a share of its reference.

    Chatter, and an oscillation at rest, beyond their bounds make it dearer.
    """
    total = []
    for name, run in (pair for by_name in runs for pair in by_name.items()):
        size = float(np.std(run.reference[:, 0 if trial.position else 1]))
        excess = [run.chatter / (CHATTER * trial.rig.limit)]
        if trial.position and STOPS in name:
            excess.append(run.oscillation(AT_REST) / trial.rig.oscillation_bound)
        beyond = sum(max(0.0, min(one, 1e3) - 1.0) for one in excess)
        total.append(min(run.rms / size, 1e3) * (1.0 + 10.0 * beyond))
    return float(np.mean(total))


def tuned(trial: Trial, design: Design, model: Model) -> dict[str, Any]:
    """Tune a design made from ``model`` on the rig, and measure it there and on other mismatched plants."""
    stand = Stand(trial, trial.tuned_on, "tuning")

    def value(tuning: Tuning) -> float:
        try:
            return cost(trial, stand.runs(design, model, tuning))
        except InputError:  # no gain for such weights
            return 1e6

    found = search(design, trial.task, value, trial.seed)
    return {"cost": found.cost, **measured(trial, design, model, found.tuning)}


def measured(trial: Trial, design: Design, model: Model, tuning: Tuning, task: Task | None = None) -> dict[str, Any]:
    """Measure a design made from ``model`` with a tuning on the plants of the table; ``task``: what it believes."""
    runs = Stand(trial, trial.measured_on, "table").runs(design, model, tuning, task)
    return {"tuning": _plain(tuning), "runs": [_measured(trial, by_name) for by_name in runs]}


def standing(trial: Trial, design: Design, tuning: Mapping[str, float]) -> list[float]:
    """Return, for the plants of the table, how far a drive swings to and fro in a long stop, in multiples of the bound.

    ``tuning``: as a result holds it.
    """
    weights = Weights(*(tuning[name] for name in ALWAYS))
    known = Tuning(weights, *(tuning[name] for name in ("floor", "friction", "turning")))
    stop = {"long stop": trial.rig.stop(LONG_STOP)}
    runs = Stand(trial, trial.measured_on, "standing", stop).runs(design, trial.rig.model, known)
    swings = [run.swing(LONG_STOP - SETTLED) for by_name in runs for run in by_name.values()]
    return [swing / trial.rig.oscillation_bound for swing in swings]


def _plain(tuning: Tuning) -> dict[str, float]:
    weights = tuning.weights
    numbers = {name: getattr(weights, name) for name in ("bandwidth", "damping", "integral")}
    return numbers | {name: getattr(tuning, name) for name in ("floor", "friction", "turning")}


def _measured(trial: Trial, by_name: Mapping[str, TrackingRun]) -> dict[str, dict[str, float]]:
    found = {}
    for name, run in by_name.items():
        standing = trial.position and STOPS in name
        found[name] = {"rms": run.rms, "effort": run.effort, "chatter": run.chatter}
        if standing:
            found[name]["oscillation"] = run.oscillation(AT_REST)
    return found


def untuned(trial: Trial) -> dict[str, Any]:
    """Return the default design's result with the weights that the node takes by itself; it knows no delay exactly."""
    design, model, task = DESIGNS[DEFAULT_DESIGN], trial.rig.model, replace(trial.task, least=trial.rig.model.delay)
    tuning = holding(design, model, task, default_tuning(task.period, task.delay))
    return {"default, untuned": measured(trial, design, model, tuning, task)}


def all_designs(trial: Trial, names: Iterable[str] = tuple(DESIGNS)) -> dict[str, Any]:
    """Return every design's result on one trial."""
    return {name: tuned(trial, DESIGNS[name], trial.rig.model) for name in names}
