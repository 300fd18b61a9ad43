"""Draw records with a hidden effect: nominal model, estimation and validation data, and the truth.

    python -m benchmarks.hidden.generator --group single --count 50 --seed 1 -o DIR

Records depend on (group, index, seed) only. Seeds by convention: `DEVELOPMENT` for everything that is tuned, `HELD_OUT`
for the figures that are published, run once after the tuning has ended.
"""

from __future__ import annotations

import argparse
import json
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from benchmarks.hidden import catalogue as every
from benchmarks.hidden import effects as catalogue
from benchmarks.hidden import laws, signals
from benchmarks.hidden.drives import (
    CHANNELS,
    EXCITATIONS,
    INPUT,
    MASS,
    MOTOR,
    Drive,
    Scale,
    draw_drive,
    excite,
    scale,
    spread,
)
from benchmarks.hidden.evidence import COMMON, SIBLINGS, Motion, evidence, shapes_of

Array = NDArray[np.float64]
Effects = dict[str, dict[str, float]]

DEVELOPMENT, HELD_OUT = 1, 2
GROUPS = ("single", "weak", "none", "none_coloured", "outside", "springs", "signals", "similar", "pair", "catalogue")
POSITION = ("position", "displacement")
BRIEFEST, LONGEST = 0.7, 0.025
"""Coloured noise: 1 less its correlation from sample to sample, which every channel has its own of."""
ENOUGH, DISTINCT, UNLIKE = 300.0, 60.0, 300.0
"""Evidence for an effect; beyond its simpler siblings; of one outside the catalogue, beyond all common shapes."""
ATTEMPTS = 400
SUITED = {
    "stribeck_friction": ("slow", "slow", "multisine", "steps"),
    "hyperbolic_stribeck": ("slow", "slow", "multisine"),
    "lugre_friction": ("slow", "slow", "multisine", "sweep"),
    "dahl_presliding": ("slow", "multisine", "sweep", "steps"),
    "curved_dahl": ("slow", "multisine", "sweep"),
    "cogging_torque": ("slow", "slow", "multisine", "steps"),
    "torque_ripple": ("slow", "slow", "multisine", "steps"),
    "play_friction": ("slow", "multisine", "sweep"),
    "pinching_hysteresis": ("slow", "multisine", "sweep"),
    "maxwell_element": ("steps", "multisine", "sweep"),
    "load_dependent_stribeck": ("slow", "slow", "multisine", "steps"),
    "input_delay": ("multisine", "prbs", "steps", "sweep"),
    "input_lag": ("multisine", "prbs", "steps", "sweep"),
    "sensor_delay": ("multisine", "prbs", "steps", "sweep"),
    "compliant_load": ("sweep", "prbs", "multisine", "steps"),
    "input_deadzone": ("multisine", "steps", "slow", "sweep"),  # not prbs: its level hardly varies
    "input_saturation": ("multisine", "steps", "slow", "sweep"),
    "arctan_saturation": ("multisine", "steps", "slow", "sweep"),
    "input_steps": ("multisine", "slow", "sweep"),
    "input_play": ("multisine", "slow", "sweep", "steps"),
    "thermal_resistance": ("multisine", "steps", "prbs"),
}


@dataclass(frozen=True)
class HiddenRecord:
    """A record: `model` as in its YAML file, data by column, and what was hidden."""

    name: str
    model: dict[str, Any]
    estimation: dict[str, Array]
    validation: dict[str, Array]
    truth: dict[str, Any]


@dataclass(frozen=True)
class Plan:
    """What is to be hidden: laws by name as in `laws`, their catalogue names, their strength; ``variant``: of a law, as
    in `catalogue.VARIANTS`.
    """

    plant: str
    hidden: tuple[str, ...]
    laws: tuple[str, ...]
    strength: float = 1.0
    kind: str = ""
    variant: str = ""


@dataclass(frozen=True)
class Conditions:
    """How the record is taken: noise and tolerance relative, fs in Hz, T in s; ``colour``: the noise's correlation from
    sample to sample in every channel.
    """

    kind: str
    noise: float
    fs: float
    T: float
    rest: bool
    detune: float
    tolerance: float
    channels: tuple[str, ...]
    exc: tuple[str, str]
    colour: Array


@dataclass(frozen=True)
class Run:
    """A simulated record without noise, with its effects' values."""

    motion: Motion
    values: Effects


@dataclass(frozen=True)
class Sizes:
    """Values of the effects at ordinary strength, and of those that are hidden."""

    ordinary: Effects
    hidden: Effects


@dataclass(frozen=True)
class Found:
    """A draw that shows what it hides."""

    drive: Drive
    conditions: Conditions
    values: Effects
    estimation: Run
    validation: Run


def _rng(*key: int | str) -> np.random.Generator:
    return np.random.default_rng([zlib.crc32(k.encode()) if isinstance(k, str) else k for k in key])


def _cycle(items: list[Any], group: str, index: int, seed: int) -> Any:
    """Return the item of an index; every item once before any comes again, in an order of the seed's."""
    order = _rng("order", group, index // len(items), seed).permutation(len(items))
    return items[order[index % len(items)]]


def plan(group: str, index: int, seed: int) -> Plan:
    """Return what a record of a group hides."""
    if group in ("none", "none_coloured"):
        plant = (MOTOR, MASS)[index % 2]
        kind = "coloured" if group == "none_coloured" else ("white", "white", "quantised")[index // 2 % 3]
        return Plan(plant, (), (), kind=kind)
    plants = (MOTOR, MASS)
    if group == "catalogue":
        entries = every.entries()
        entry = entries[index % len(entries)]
        return Plan(entry.plant, (entry.law,), (entry.law,), variant=entry.variant)
    if group == "pair":
        pairs = [(p, pair) for p in plants for pair in catalogue.PAIRS if all(catalogue.applies(e, p) for e in pair)]
        plant, pair = _cycle(pairs, group, index, seed)
        return Plan(plant, pair, pair)
    if group in catalogue.UNLISTED:
        names = [(p, e) for p in plants for e in catalogue.UNLISTED[group]]
        plant, name = _cycle(names, group, index, seed)
        return Plan(plant, (f"(unlisted) {name}",), (name,))
    if group == "similar":
        nearest = {e: entry[0] for e, entry in catalogue.SIMILAR.items()}
        names = [(p, e) for p in plants for e in nearest if catalogue.applies(nearest[e], p)]
        plant, name = _cycle(names, group, index, seed)
        return Plan(plant, (catalogue.SIMILAR[name][0],), (name,))
    names = [(p, e) for p in plants for e in catalogue.LISTED if catalogue.applies(e, p)]
    plant, name = _cycle(names, group, index, seed)
    return Plan(plant, (name,), (name,), strength=1.0 if group == "single" else 1.0 / 3.0)


def _channels(rng: np.random.Generator, p: Plan) -> tuple[str, ...]:
    """All channels mostly; few where that leaves the effect visible: a sensor's error needs another sensor, a load that
    only shifts where a spring rests does not show in the velocity, and harmonics need the position that they go with.
    """
    every = CHANNELS[p.plant]
    if rng.random() < 0.7 or any(name.startswith("sensor_") or name == "torque_ripple" for name in p.laws):
        return every
    motor = [("speed",), ("current", "speed"), ("speed", "position"), ("current", "position"), ("position",)]
    few: list[tuple[str, ...]] = motor if p.plant == MOTOR else [("displacement",), ("velocity",)]
    chosen = few[int(rng.integers(len(few)))]
    return few[0] if p.plant == MASS and "constant_load" in p.laws else chosen


def _conditions(rng: np.random.Generator, p: Plan) -> Conditions:
    kind = p.kind or str(rng.choice(["white", "coloured", "quantised"], p=[0.7, 0.15, 0.15]))
    channels = _channels(rng, p)
    if kind == "quantised" and not set(channels) & set(POSITION):
        kind = "white"
    suited = SUITED.get(p.laws[0], EXCITATIONS) if p.laws else EXCITATIONS
    detune = float(rng.choice([0.0, 0.05, 0.1], p=[0.2, 0.65, 0.15]))
    return Conditions(
        kind=kind,
        noise=float(rng.choice([0.01, 0.01, 0.02, 0.03])),
        fs=float(rng.choice([200.0, 100.0, 500.0], p=[0.8, 0.1, 0.1])),
        T=float(rng.choice([16.0, 8.0, 12.0, 20.0], p=[0.7, 0.1, 0.1, 0.1])),
        rest=bool(rng.random() < 0.6),
        detune=detune,
        tolerance=max(detune, 0.05),
        channels=channels,
        exc=(str(rng.choice(suited)), str(rng.choice(suited))),
        colour=_colour(rng, kind, len(CHANNELS[p.plant])),
    )


def _colour(rng: np.random.Generator, kind: str, channels: int) -> Array:
    """Return the correlation (ny,) of noise from sample to sample; what else is drawn does not depend on it."""
    own = rng.spawn(1)[0]
    return 1.0 - np.array([spread(own, LONGEST, BRIEFEST) if kind == "coloured" else 1.0 for _ in range(channels)])


def _parameters(drive: Drive, values: Effects) -> Any:
    """Return the row of `laws.DTYPE`."""
    p = np.zeros(1, laws.DTYPE)[0]
    renamed = {"R_a": "R", "L_a": "L", "J": "m", "B": "c"} if drive.plant == MOTOR else {}
    for name, value in drive.true.items():
        p[renamed.get(name, name)] = value
    p["motor"] = float(drive.plant == MOTOR)
    for effect, parameters in values.items():
        for name, value in parameters.items():
            if laws.field(effect, name) in laws.NAMES:
                p[laws.field(effect, name)] = value
    return p


def _seen(dense: Array, parts: int, skip: int, aux: Array, drive: Drive, values: Effects, dt: float) -> Array:
    """Return what the sensors show at the samples, each late by its own delay."""
    columns = (0, 1, 2) if drive.plant == MOTOR else (2, 1)
    grid = np.arange(len(dense)) * dt / parts
    at = np.arange(skip, len(aux)) * dt
    out = np.empty((len(at), len(columns)))
    for j, (name, column) in enumerate(zip(CHANNELS[drive.plant], columns, strict=True)):
        delay = values.get("sensor_delay", {}).get(name, 0.0)
        out[:, j] = signals.shown(np.interp(at - delay, grid, dense[:, column]), name, values, aux[skip:])
    return out


def simulate(drive: Drive, values: Effects, u: Array, aux: Array, dt: float, skip: int, step: float) -> Run | None:
    """Return the record after ``skip`` samples from rest; None where the motion diverges."""
    delay = values.get("input_delay", {}).get("T", 0.0)
    found = laws.trajectory(_parameters(drive, values), signals.reaching(u, values), aux, dt, delay, step)
    if found is None:
        return None
    dense, parts = found
    sampled = dense[skip * parts : -1 : parts]
    shown = _seen(dense, parts, skip, aux, drive, values, dt)
    motion = Motion(u[skip:], shown, sampled[:, 1].copy(), sampled[:, 2].copy(), sampled[:, 3].copy(), dt)
    return Run(motion, values)


def _inputs(rng: np.random.Generator, drive: Drive, c: Conditions, exc: str, law: str) -> tuple[Array, Array, int]:
    """Return the commanded input and the auxiliary signal, and how many samples come before the record."""
    skip = 0 if c.rest else round(rng.uniform(1.0, 2.5) * c.fs)
    t = np.arange(-skip, round(c.T * c.fs)) / c.fs
    return excite(rng, exc, drive, t), signals.auxiliary(rng, law, t), skip


def _sizes(rng: np.random.Generator, p: Plan, drive: Drive, u: Array, c: Conditions) -> Effects:
    """Draw the effects' values at ordinary strength."""
    s = catalogue.Setting(rng, drive, scale(drive, u, 1 / c.fs), c.T, 1 / c.fs)
    table = {**catalogue.LISTED, **catalogue.OUTSIDE, **catalogue.SPRINGS, **catalogue.SIGNALS}
    values: Effects = {}
    for name in p.laws:
        law, draw_values = name, table.get(name)
        if name in catalogue.SIMILAR:
            _, law, draw_values = catalogue.SIMILAR[name]
        if p.variant or (draw_values is None and name in every.VARIANTS):
            draw_values = every.sizes(every.Entry(p.plant, name, p.variant))
        if draw_values is None:
            raise ValueError(f"no sizes for the law {name!r}; known: {', '.join(table)}")
        values[law] = {n: float(v) for n, v in draw_values(s).items()}
    if "gravity_load" in values and "load_dependent_friction" in values:
        values["load_dependent_friction"]["kappa_e"] = s.share()
    return values


def _moves(run: Run, expected: Scale) -> bool:
    """Tell whether the drive still moves, and not much more than it would with nothing hidden."""
    m = run.motion
    speed = float(np.sqrt(np.mean(m.v**2)))
    stuck = float(np.mean(np.abs(m.s) < 1.0)) if np.any(m.s) else 0.0
    return 0.2 * expected.speed < speed < 4.0 * expected.speed and stuck < 0.5


def _sigma(run: Run, drive: Drive, c: Conditions) -> Array:
    """Return the noise of each channel, infinite where it is not measured; where it is coloured, that of white noise
    which hides as much: correlated samples say less.
    """
    measured = np.array([n in c.channels for n in CHANNELS[drive.plant]])
    lasting = np.sqrt((1.0 + c.colour) / (1.0 - c.colour))
    return np.where(measured, lasting * c.noise * run.motion.shown.std(axis=0), np.inf)


def _visible(p: Plan, drive: Drive, run: Run, c: Conditions, factor: float) -> bool:
    """Tell whether each hidden effect shows, beyond what the base and simpler laws can imitate."""
    sigma = _sigma(run, drive, c)

    def shows(shapes: tuple[str, ...], threshold: float) -> bool:
        return evidence(drive, run.motion, sigma, c.tolerance, tuple(dict.fromkeys(shapes))) > threshold * factor

    if p.hidden and p.hidden[0].startswith("("):
        return shows(COMMON, UNLIKE)
    if not shows((), ENOUGH):
        return False
    if len(p.hidden) == 1:
        siblings = SIBLINGS.get(p.hidden[0], ())
        return not siblings or shows(siblings, DISTINCT)
    a, b = p.hidden
    pairs = ((a, b), (b, a))
    return all(shows((*SIBLINGS.get(x, ()), *shapes_of(y, run.values[y])), DISTINCT) for x, y in pairs)


def _suits(p: Plan, expected: Scale) -> bool:
    """Tell, before anything is simulated, whether the motion can show an effect: gravity needs to swing."""
    return "gravity_load" not in p.hidden or expected.position > 0.4


def _run(
    rng: np.random.Generator, p: Plan, drive: Drive, c: Conditions, sizes: Sizes | None, exc: str
) -> tuple[Run, Sizes] | None:
    """Draw one data set (the first draws the sizes too); None if the effect at ordinary strength does not show."""
    u, aux, skip = _inputs(rng, drive, c, exc, p.laws[0] if p.laws else "")
    expected, dt = scale(drive, u[skip:], 1 / c.fs), 1 / c.fs
    if sizes is None and not _suits(p, expected):
        return None
    least = 1.0 if sizes is None else 0.25
    if sizes is None:
        ordinary = _sizes(rng, p, drive, u[skip:], c)
        weak = {e: catalogue.weaken(e, v, p.strength, u) for e, v in ordinary.items()}
        sizes = Sizes(ordinary, ordinary if p.strength == 1.0 else weak)
    run = simulate(drive, sizes.ordinary, u, aux, dt, skip, laws.STEP)
    if run is None or not _moves(run, expected) or (p.laws and not _visible(p, drive, run, c, least)):
        return None
    if p.strength != 1.0:
        run = simulate(drive, sizes.hidden, u, aux, dt, skip, laws.STEP)
    return (run, sizes) if run else None


def _noise(rng: np.random.Generator, colour: Array, sigma: Array, count: int) -> Array:
    noise = rng.normal(size=(count, len(sigma)))
    for k in range(1, count) if colour.any() else ():
        noise[k] = colour * noise[k - 1] + np.sqrt(1 - colour**2) * noise[k]
    return noise * sigma


def _measure(
    rng: np.random.Generator, run: Run, drive: Drive, c: Conditions, step: float
) -> tuple[dict[str, Array], dict[str, float]]:
    """Return the data with noise, and the noise; ``step``: of the encoder, where there is one."""
    names = CHANNELS[drive.plant]
    sigma: Array = c.noise * run.motion.shown.std(axis=0)
    shown = run.motion.shown + _noise(rng, c.colour, sigma, len(run.motion.u))
    if c.kind == "quantised":
        for j, name in enumerate(names):
            if name in POSITION:
                shown[:, j] = step * np.round(run.motion.shown[:, j] / step)
                sigma[j] = step / np.sqrt(12)
    t = np.asarray(np.arange(len(run.motion.u)) * run.motion.dt, dtype=np.float64)
    data: dict[str, Array] = {"t": t, INPUT[drive.plant]: run.motion.u}
    data |= {n: shown[:, j] for j, n in enumerate(names) if n in c.channels}
    return data, {n: float(sigma[j]) for j, n in enumerate(names) if n in c.channels}


def _nominal(rng: np.random.Generator, drive: Drive, c: Conditions) -> dict[str, float]:
    """Return the base parameters as the user believes them, to five digits."""
    off = {n: 1 + rng.uniform(-c.detune, c.detune) for n in drive.true}
    if "K_m" in off:
        off["K_m"] = off["K_t"]  # one magnet, one constant
    return {n: float(f"{value / off[n]:.5g}") for n, value in drive.true.items()}


def _attempt(rng: np.random.Generator, p: Plan) -> Found | None:
    c = _conditions(rng, p)
    drive = draw_drive(rng, p.plant)
    estimation = _run(rng, p, drive, c, None, c.exc[0])
    if estimation is None:
        return None
    for _ in range(6):
        validation = _run(rng, p, drive, c, estimation[1], c.exc[1])
        if validation is not None:
            return Found(drive, c, estimation[1].hidden, estimation[0], validation[0])
        c = replace(c, exc=(c.exc[0], c.exc[0]))  # the second excitation does not show the effect: the first does
    return None


def _evidence(p: Plan, found: Found) -> dict[str, float]:
    """Return the evidence in the estimation record at its strength: beyond the base, and beyond simpler laws too."""
    c, run = found.conditions, found.estimation
    sigma = _sigma(run, found.drive, c)
    shapes = {"base": (), "siblings": SIBLINGS.get(p.hidden[0], COMMON) if len(p.hidden) == 1 else ()}
    return {n: evidence(found.drive, run.motion, sigma, c.tolerance, s) for n, s in shapes.items()}


def _truth(
    p: Plan, found: Found, name: str, key: tuple[int, int], sigma: dict[str, dict[str, float]]
) -> dict[str, Any]:
    """Return what was hidden and how the record was taken, in the names of the shared examples."""
    c, every = found.conditions, CHANNELS[p.plant]
    return {
        "name": name,
        "plant": p.plant,
        "hidden": list(p.hidden) or ["none"],
        "laws": list(p.laws),
        "values": {e: {n: v for n, v in values.items() if n != "k" or v} for e, values in found.values.items()},
        "strength": p.strength,
        "variant": p.variant,
        "true": found.drive.true,
        "noise_sigma": sigma,
        "kind": c.kind,
        "noise": c.noise,
        "colour": c.colour.tolist(),
        "rest": c.rest,
        "exc": list(c.exc),
        "fs": c.fs,
        "T": c.T,
        "detune": c.detune,
        "channels": None if c.channels == every else list(c.channels),
        "evidence": _evidence(p, found),
        "seed": key[0],
        "attempt": key[1],
    }


def _model(rng: np.random.Generator, drive: Drive, c: Conditions) -> dict[str, Any]:
    """Return the nominal model; the tolerance only where it is not the usual 5 %."""
    parameters: dict[str, Any] = {"plant": drive.plant, "parameters": _nominal(rng, drive, c)}
    if c.tolerance != 0.05:
        parameters["tolerance"] = c.tolerance
    return {"/**": {"ros__parameters": parameters}}


def _record(rng: np.random.Generator, name: str, p: Plan, found: Found, key: tuple[int, int]) -> HiddenRecord:
    c, drive = found.conditions, found.drive
    place = next(j for j, n in enumerate(CHANNELS[p.plant]) if n in POSITION)
    step = float(found.estimation.motion.shown[:, place].std()) * spread(rng, 5e-4, 2e-2)
    if p.plant == MOTOR:
        step = 2 * np.pi / float(rng.choice([500, 1024, 2000, 4096, 8192]))
    estimation, sigma = _measure(rng, found.estimation, drive, c, step)
    validation, sigma2 = _measure(rng, found.validation, drive, c, step)
    truth = _truth(p, found, name, key, {"estimation": sigma, "validation": sigma2})
    return HiddenRecord(name, _model(rng, drive, c), estimation, validation, truth)


def draw(group: str, index: int, master_seed: int) -> HiddenRecord:
    """Return a record; the same for the same arguments."""
    if group not in GROUPS:
        raise ValueError(f"no group {group!r}; known: {', '.join(GROUPS)}")
    p = plan(group, index, master_seed)
    rng = _rng(group, index, master_seed)
    for attempt in range(ATTEMPTS):
        found = _attempt(rng, p)
        if found is not None:
            return _record(rng, f"{group}_{index:03d}", p, found, (master_seed, attempt))
    raise RuntimeError(f"{group} {index}: {', '.join(p.laws)} on {p.plant} did not show in {ATTEMPTS} draws")


def write(record: HiddenRecord, folder: Path) -> Path:
    """Write a record's files into a folder of its name; return that folder."""
    place = folder / record.name
    place.mkdir(parents=True, exist_ok=True)
    (place / "model.yaml").write_text(yaml.safe_dump(record.model, sort_keys=False), encoding="utf-8")
    (place / "truth.json").write_text(json.dumps(record.truth, indent=1), encoding="utf-8")
    for name, data in (("estimation", record.estimation), ("validation", record.validation)):
        table = np.column_stack(list(data.values()))
        np.savetxt(place / f"{name}.csv", table, "%.8g", ",", header=",".join(data), comments="")
    return place


def main() -> None:
    """Write records."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--group", choices=GROUPS, default="single")
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--first", type=int, default=0, help="index of the first record")
    parser.add_argument("--seed", type=int, default=DEVELOPMENT)
    parser.add_argument("-o", dest="folder", type=Path, required=True)
    arguments = parser.parse_args()
    for index in range(arguments.first, arguments.first + arguments.count):
        record = draw(arguments.group, index, arguments.seed)
        write(record, arguments.folder)
        truth = record.truth
        print(record.name, truth["plant"], "+".join(truth["hidden"]), truth["exc"], f"attempt {truth['attempt']}")


if __name__ == "__main__":
    main()
