"""Score the diagnosis on simulated servos: ``python -m benchmarks.servo [--laws 20] [--none 10] [--seed 1]``.

A seed has its law (1 the first of the ten, 11 again), so that chunks of a long run are ``--seed 1 --laws 5``,
``--seed 6 --laws 5``, and so on.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from benchmarks.servo.second import LAWS, Log, Servo, logs
from signlin_ros.diagnosis.verbs import diagnose
from signlin_ros.model import Model
from signlin_ros.records import ModelData

BENCH = [(kp, mass) for kp in (100.0, 200.0, 400.0) for mass in (0.25, 0.5)]
OFF = 0.06
"""How far the base parameters of the model are off, relative, uniformly."""
HAS = ("viscous_friction", "coulomb_friction")


def given(servo: Servo, rng: np.random.Generator) -> Model:
    """Return the model that is handed out: the servo without its hidden law, base parameters off."""
    names = ("K_t", "R", "J")
    parameters = {n: getattr(servo, n) * (1 + OFF * rng.uniform(-1, 1)) for n in names}
    parameters |= {"length": servo.length, "duty_per_error": servo.duty_per_error, "vin": servo.vin, "kp": 200.0}
    effects = {"viscous_friction": {"b": servo.b}} | ({"coulomb_friction": {"mu": servo.mu}} if servo.mu else {})
    frozen = ["length", "duty_per_error", "vin", "duty_limit"]
    content = {"plant": "servo", "parameters": parameters, "effects": effects, "tolerance": 0.05, "frozen": frozen}
    return Model.from_dict({**content, "update_period": 0.05})


def data(log: Log, model: Model, number: int) -> ModelData:
    """Return a log in the model's terms."""
    measured = {"position": log.position, "speed": log.speed}
    x0 = np.array([log.position[0], log.speed[0]])
    source = f"log {number} (kp {log.kp:g}, mass {log.mass:g})"
    conditions = {"kp": log.kp, "mass": log.mass}
    inputs = log.goal[:, None]
    return ModelData(
        log.t, inputs, measured, x0, model.inputs, model.states, model.units, source, conditions=conditions
    )


def answer(law: str, seed: int) -> tuple[str, bool, tuple[str, ...]]:
    """Return verdict, whether it is right or tied, and the effects named."""
    rng = np.random.default_rng(seed)
    servo = Servo()
    if law:
        size = rng.uniform(0.7, 1.3)
        scaled = {n: v * (1.0 if n in ("N", "phi", "v_s", "sigma") else size) for n, v in LAWS[law].items()}
        servo = replace(servo, law=law, values=scaled, mu=0.0 if law == "coulomb_friction" else servo.mu)
    model = given(servo, rng)
    found = diagnose(model, [data(log, model, i) for i, log in enumerate(logs(servo, BENCH, seed), 1)], jobs=1)
    names = found.ladder[-1].effects if found.verdict != "adequate" else ()
    ties = {t for entry in found.ranking if entry.effect in names for t in entry.indistinguishable_from}
    right = (law in {*names, *ties}) if law else not names
    return found.verdict, right, names


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--laws", type=int, default=20)
    parser.add_argument("--none", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    every = list(LAWS)
    cases = [(every[(seed - 1) % len(every)], seed) for seed in range(options.seed, options.seed + options.laws)]
    cases += [("", options.seed + 1000 + k) for k in range(options.none)]
    counts = {True: [0, 0], False: [0, 0]}
    for law, seed in cases:
        begun = time.process_time()
        verdict, right, names = answer(law, seed)
        counts[bool(law)][0] += right
        counts[bool(law)][1] += 1
        spent = time.process_time() - begun
        mark = "right" if right else "WRONG"
        print(
            f"{seed:5d} {law or 'nothing':28s} {mark} {verdict:12s} {', '.join(names) or '-'}  {spent:.0f} s",
            flush=True,
        )
    print(
        f"hidden laws: {counts[True][0]} of {counts[True][1]}; nothing hidden: {counts[False][0]} of {counts[False][1]}"
    )


if __name__ == "__main__":
    main()
