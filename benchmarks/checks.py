"""What the checks find in clean records, and what of faults that are put into them.

    python -m benchmarks.checks --count 200 --faults 60

Records are those of `benchmarks.hidden.generator`: clean ones (group ``none``), and ones with hidden effects, of which
nothing may be offered or refused either. Every fault is put into a number of clean records that can show it.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.hidden import generator
from signlin_ros.checks import Finding, check
from signlin_ros.checks.base import with_channel
from signlin_ros.checks.exchanged import exchanged
from signlin_ros.model import Model
from signlin_ros.records import ModelData, Record, Signal

Array = NDArray[np.float64]

EFFECTS = ("single", "signals", "outside", "similar", "springs", "none_coloured")
TURN = 2.0 * np.pi


@dataclass(frozen=True)
class Case:
    """A record, the model that it is checked with, and what is hidden in it."""

    name: str
    model: Model
    data: ModelData


def case(group: str, index: int, seed: int) -> Case:
    """Return a record of the generator as the command line would read it."""
    drawn = generator.draw(group, index, seed)
    content = drawn.model["/**"]["ros__parameters"]
    columns = dict(drawn.estimation)
    t = columns.pop("t")
    model = Model.from_dict(content)
    if model.plant.position_optional and "position" in columns:
        model = model.with_options(with_position=True)
    record = Record(t, {name: Signal(values) for name, values in columns.items()}, drawn.name)
    hidden = "+".join(drawn.truth["hidden"])
    return Case(f"{drawn.name} {hidden}", model, record.for_model(model))


def told(found: list[Finding]) -> list[Finding]:
    """Return what is offered, refused or changed."""
    return [finding for finding in found if finding.severity != "note" or finding.applied]


# ------------------------------------------------------------------ faults


Fault = Callable[[Case], "ModelData | None"]


def _signal(c: Case, name: str) -> Array | None:
    if name in c.data.measured:
        return c.data.measured[name]
    return c.data.u[:, c.data.inputs.index(name)] if name in c.data.inputs else None


def _mixed(*order: str) -> Fault:
    """Return the fault that takes signals for each other, where all of them are recorded."""

    def fault(c: Case) -> ModelData | None:
        return exchanged(c.data, order) if all(_signal(c, name) is not None for name in order) else None

    return fault


def _on(name: str, change: Callable[[Array], Array | None]) -> Fault:
    """Return the fault that changes one signal, where it is recorded."""

    def fault(c: Case) -> ModelData | None:
        values = _signal(c, name)
        new = None if values is None else change(values)
        return None if new is None else with_channel(c.data, name, new)

    return fault


def _every(c: Case, change: Callable[[Array], Array]) -> ModelData:
    return replace(c.data, measured={n: change(v) for n, v in c.data.measured.items()})


def _wrapped(q: Array) -> Array | None:
    """An angle of several turns whose sensor is one of an angle: noise of the generator grows with the travel."""
    noise = float(np.std(np.diff(q, 4))) / np.sqrt(70.0)
    told = np.ptp(q) > 1.5 * TURN and noise < 0.1 and np.percentile(np.abs(np.diff(q)), 99) < 0.3 * TURN
    return (q + np.pi) % TURN - np.pi if told else None


def _overflow(v: Array) -> Array | None:
    step = np.ptp(v) / 350.0
    whole = step * np.round(v / step)
    return (whole + 128 * step) % (256 * step) - 128 * step if np.ptp(v) > 0 else None


def _clipped(v: Array) -> Array:
    low, high = np.percentile(v, (5, 95))
    return np.clip(v, low, high)


def _third_is_zero(v: Array) -> Array:
    return np.where(np.arange(v.size) % 3 == 2, 0.0, v)


def _unsigned(c: Case) -> ModelData | None:
    u = c.data.u[:, 0]
    both = min(np.mean(u > 0), np.mean(u < 0)) > 0.2
    return with_channel(c.data, c.data.inputs[0], np.abs(u)) if both else None


def _late_input(c: Case) -> ModelData:
    u = c.data.u[:, 0]
    return with_channel(c.data, c.data.inputs[0], np.concatenate([np.full(20, u[0]), u[:-20]]))


def _still(c: Case) -> ModelData:
    rng = np.random.default_rng(1)
    return _every(c, lambda v: 0.01 * np.std(v) * rng.normal(size=v.size))


def _jittered(c: Case) -> ModelData:
    step = float(np.median(np.diff(c.data.t)))
    return replace(c.data, t=c.data.t + 0.4 * step * np.random.default_rng(1).uniform(size=len(c.data)))


def _rpm(v: Array) -> Array:
    return 60.0 / TURN * v


def _degrees(c: Case) -> ModelData | None:
    """Position and velocity both in degrees."""
    names = [n for n in (c.model.plant.position, c.model.plant.velocity) if n in c.data.measured]
    if len(names) < 2 or c.model.plant.name != generator.MOTOR:
        return None
    return replace(c.data, measured={n: v * (360.0 / TURN if n in names else 1.0) for n, v in c.data.measured.items()})


UNITS = ("unit_or_sign", "position_velocity")
FAULTS: dict[str, tuple[tuple[str, ...], Fault]] = {
    "position wraps": (("wrapped_angle",), _on("position", _wrapped)),
    "speed overflows": (("integer_overflow",), _on("speed", _overflow)),
    "velocity overflows": (("integer_overflow",), _on("velocity", _overflow)),
    "zeros, every third": (("two_sources",), lambda c: _every(c, _third_is_zero)),
    "zeros in the input": (("two_sources",), lambda c: with_channel(c.data, c.data.inputs[0],
                                                                    _third_is_zero(c.data.u[:, 0]))),
    "speed held 4 samples": (("repeated_values",), _on("speed", lambda v: np.repeat(v[::4], 4)[: v.size])),
    "velocity held 4 samples": (("repeated_values",), _on("velocity", lambda v: np.repeat(v[::4], 4)[: v.size])),
    "speed is 0": (("frozen_channel",), _on("speed", np.zeros_like)),
    "velocity is 0": (("frozen_channel",), _on("velocity", np.zeros_like)),
    "current clipped": (("clipped",), _on("current", _clipped)),
    "speed clipped": (("clipped",), _on("speed", _clipped)),
    "displacement clipped": (("clipped",), _on("displacement", _clipped)),
    "current for speed": (("exchanged",), _mixed("current", "speed")),
    "voltage for current": (("exchanged",), _mixed("voltage", "current")),
    "displacement for velocity": (("exchanged",), _mixed("displacement", "velocity")),
    "current in mA": (UNITS, _on("current", lambda v: 1e3 * v)),
    "voltage in mV": (UNITS, _on("voltage", lambda v: 1e3 * v)),
    "speed in rpm": (UNITS, _on("speed", _rpm)),
    "speed in turns/s": (UNITS, _on("speed", lambda v: v / TURN)),
    "position in degrees": (UNITS, _on("position", lambda v: 360.0 / TURN * v)),
    "position in turns": (UNITS, _on("position", lambda v: v / TURN)),
    "both in degrees": (UNITS, _degrees),
    "force in kN": (UNITS, _on("force", lambda v: 1e-3 * v)),
    "force in lbf": (UNITS, _on("force", lambda v: v / 4.4482)),
    "displacement in mm": (UNITS, _on("displacement", lambda v: 1e3 * v)),
    "velocity in mm/s": (UNITS, _on("velocity", lambda v: 1e3 * v)),
    "voltage reversed": (UNITS, _on("voltage", np.negative)),
    "force reversed": (UNITS, _on("force", np.negative)),
    "speed reversed": (UNITS, _on("speed", np.negative)),
    "velocity reversed": (UNITS, _on("velocity", np.negative)),
    "input without a sign": (("unsigned_input",), _unsigned),
    "speed without a sign": (("unsigned_speed",), _on("speed", np.abs)),
    "velocity without a sign": (("unsigned_speed",), _on("velocity", np.abs)),
    "input 20 samples late": (("mixed_clocks",), _late_input),
    "no motion": (("no_motion",), _still),
    "time in ms": (("time_unit", "slow_sampling"), lambda c: replace(c.data, t=1e3 * c.data.t)),
    "jitter": (("jitter",), _jittered),
}  # fmt: skip
"""By name: the checks that may tell a fault, and what makes one of a record (None: this record cannot show it)."""


def faulty(cases: list[Case], fault: Fault) -> Iterator[tuple[Case, ModelData]]:
    """Yield the records that show a fault."""
    for c in cases:
        data = fault(c)
        if data is not None:
            yield c, data


# ------------------------------------------------------------------ printing


def clean(group: str, count: int, seed: int) -> list[Case]:
    """Print what is told of clean records; return the cases."""
    cases, wrong, kinds, notes, spent = [], 0, Counter[str](), Counter[str](), []
    for index in range(count):
        c = case(group, index, seed)
        begun = time.process_time()
        _, found = check(c.model, [c.data])
        spent.append(time.process_time() - begun)
        bad = told(found)
        wrong += bool(bad)
        kinds.update(f.check for f in bad)
        notes.update(f.check for f in found if f not in bad)
        for f in bad:
            print(f"    {c.name}: {f.severity} {f.check}: {f.said}", flush=True)
        cases.append(c)
    print(f"{group:14} {count - wrong} of {count} left alone; wrong {dict(kinds)}; notes {dict(notes)};"
          f" {np.median(spent):.2f} s each", flush=True)  # fmt: skip
    return cases


def detection(cases: list[Case], most: int) -> None:
    """Print how often each fault is told, and how often something else is told instead or too."""
    print(f"{'fault':26} told    of  otherwise")
    for name, (checks, fault) in FAULTS.items():
        right, count, other = 0, 0, Counter[str]()
        for c, data in faulty(cases, fault):
            _, found = check(c.model, [data])
            right += any(f.check in checks for f in found)
            other.update(f.check for f in told(found) if f.check not in checks)
            count += 1
            if count == most:
                break
        print(f"{name:26} {right:4} {count:5}  {dict(other) or ''}", flush=True)


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--effects", type=int, default=40, help="records of each group with hidden effects")
    parser.add_argument("--faults", type=int, default=40, help="records into which each fault is put")
    parser.add_argument("--seed", type=int, default=generator.DEVELOPMENT)
    arguments = parser.parse_args()
    cases = clean("none", arguments.count, arguments.seed)
    detection(cases, arguments.faults)
    for group in EFFECTS:
        clean(group, arguments.effects, arguments.seed)


if __name__ == "__main__":
    main()
