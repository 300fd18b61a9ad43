"""Hidden effects of a simulated arm: are joint and effect named, are neighbours left in peace?

The truth is Pinocchio's forward dynamics, an independent program, under a PD controller with feed-forward from the
wrong model, with friction that sticks and slips; its links differ from the URDF (mass 10 %, centre 1 cm, inertia 20 %);
sensors are noisy, and the gears ripple. The model is the URDF with viscous and Coulomb friction in every joint.

usage: python -m benchmarks.arms UR10E.urdf KIND COUNT SEED     (KIND: none, coulomb, load_dependent, payload, gain,
compliance, stribeck, cubic_viscous, or all)
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np
import pinocchio as pin

from signlin_ros.arms.data import ArmRun
from signlin_ros.arms.told import diagnosed_json
from signlin_ros.arms.verbs import diagnose
from signlin_ros.model import Model
from signlin_ros.robots import read_urdf
from signlin_ros.robots.inertia import about_centre, from_pseudo_inertia, moved, pseudo_inertia

RATE, LENGTH, INNER = 100.0, 24.0, 10
FRICTION = {
    "viscous": np.array([15, 15, 8, 3, 2.5, 2.5]),
    "coulomb": np.array([9, 9, 5, 2, 2.5, 2.2]),
    "inertia": np.array([3.0, 3.0, 1.5, 0.4, 0.3, 0.3]),
}
CREEP = np.array([3e-3, 3e-3, 3e-3, 6e-3, 8e-3, 8e-3])
"""rad/s within which friction rises: what sticks creeps."""
KINDS = ("none", "coulomb", "load_dependent", "payload", "gain", "compliance", "stribeck", "cubic_viscous")


def excitation(rng, n):
    """Return position, velocity, acceleration (T, n) of a motion of eight sines at the inner rate."""
    t = np.arange(0.0, LENGTH, 1.0 / (RATE * INNER))
    centre = rng.uniform(-1, 1, n) * [1, 0.5, 1, 1, 1, 1] + np.array([0, -1.3, 0.5, 0, 0, 0])
    q, v, a = (np.zeros((t.size, n)) for _ in range(3))
    for k in range(1, 9):
        w = 2 * np.pi * k / LENGTH * 1.5
        size, phase = rng.normal(0, 0.55, n) / k**0.8, rng.uniform(0, 2 * np.pi, n)
        q += size * np.sin(w * t[:, None] + phase)
        v += size * w * np.cos(w * t[:, None] + phase)
        a -= size * w * w * np.sin(w * t[:, None] + phase)
    return t, centre + q, v, a


def true_bodies(robot, rng):
    """Return inertial parameters (10 n,) that are off by what a data sheet is, of bodies that exist."""
    found = []
    for joint in robot.joints:
        m = joint.pi[0]
        centre = joint.pi[1:4] / m if m > 1e-6 else np.zeros(3)
        own = moved(joint.pi, np.eye(3), -centre)
        mass, size = 1 + 0.1 * rng.normal(), 1 + 0.2 * np.clip(rng.normal(), -2, 2)
        J = pseudo_inertia(own) * mass
        J[:3, :3] *= size
        found.append(moved(from_pseudo_inertia(J), np.eye(3), centre + 0.01 * rng.normal(size=3)))
    return np.concatenate(found)


def draw(kind, rng, n=6):
    """Return what is hidden: kind, joint, size and shape."""
    i = int(rng.integers(n))
    if kind == "load_dependent":
        return kind, int(rng.choice([1, 2, 3])), rng.uniform(0.06, 0.15), 0.0
    if kind == "payload":
        return kind, -1, rng.uniform(1, 5), 0.0
    if kind == "gain":
        return kind, i, float(rng.choice([0.8, 0.85, 1.15, 1.2])), 0.0
    if kind == "compliance":
        i = int(rng.choice([0, 1, 2]))
        return kind, i, rng.uniform(2000, 6000) * [1, 1, 0.5][i], 0.0
    if kind == "stribeck":
        return kind, i, rng.uniform(0.5, 1.0) * FRICTION["coulomb"][i], rng.uniform(0.05, 0.15)
    if kind == "cubic_viscous":
        return kind, i, -rng.uniform(0.05, 0.15) * FRICTION["viscous"][i], 0.0
    return kind, i, 0.0, 0.0


class Truth:
    """The true arm in Pinocchio, with friction, and what is hidden in it."""

    def __init__(self, urdf, robot, rng, hidden):
        self.hidden, n = hidden, robot.n
        self.model = pin.buildModelFromUrdf(urdf)
        bodies = true_bodies(robot, rng).reshape(n, -1)
        if hidden[0] == "payload":
            centre = np.array([0, 0, 0.08]) + 0.02 * rng.normal(size=3)
            bodies[-1] += about_centre(hidden[2], centre, 0.004 * hidden[2] * np.eye(3))
        for k, body in enumerate(bodies):
            c = body[1:4] / body[0]
            about = moved(body, np.eye(3), -c)[4:][[[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
            self.model.inertias[k + 1] = pin.Inertia(body[0], c, about)
        self.f = {name: values * rng.uniform(0.8, 1.25, n) for name, values in FRICTION.items()}
        self.data, self.nominal = self.model.createData(), pin.buildModelFromUrdf(urdf)
        self.nominal_data = self.nominal.createData()

    def friction(self, v, load):
        """Return the friction of the motors (n,) at speeds v under loads of the gears."""
        kind, i, size, shape = self.hidden
        level, more = self.f["coulomb"].copy(), self.f["viscous"] * v
        if kind == "load_dependent":
            level[i] += size * abs(load[i])
        if kind == "stribeck":
            level[i] += size * np.exp(-((v[i] / shape) ** 2))
        if kind == "cubic_viscous":
            more[i] += size * v[i] ** 3
        return level * np.tanh(v / CREEP) + more

    def run(self, rng):
        """Return t, and the motors' positions, velocities and efforts as sensors show them at 100 Hz."""
        t, q_d, v_d, a_d = excitation(rng, self.model.nv)
        dt, elastic = t[1], self.hidden[1] if self.hidden[0] == "compliance" else -1
        gains = np.array([4000, 4000, 2500, 600, 500, 400.0])
        damping = np.array([250, 250, 120, 25, 20, 18.0])
        q, v, load = q_d[0].copy(), v_d[0].copy(), np.zeros(self.model.nv)
        theta, w = q.copy(), v.copy()
        self.model.armature[:] = self.f["inertia"]
        self.nominal.armature[:] = FRICTION["inertia"]
        if elastic >= 0:
            self.model.armature[elastic] = 0.0
            theta[elastic] += pin.rnea(self.model, self.data, q, v, a_d[0])[elastic] / self.hidden[2]
        rows = []
        for k in range(t.size):
            ff = pin.rnea(self.nominal, self.nominal_data, q_d[k], v_d[k], a_d[k])
            u = (
                ff
                + gains * (q_d[k] - theta)
                + damping * (v_d[k] - w)
                + 0.8 * FRICTION["coulomb"] * np.tanh(v_d[k] / 0.05)
            )
            rub = self.friction(w, load)
            applied = u - rub
            if elastic >= 0:
                spring = self.hidden[2] * (theta[elastic] - q[elastic]) + 5.0 * (w[elastic] - v[elastic])
                applied[elastic] = spring
                w[elastic] += dt * (u[elastic] - rub[elastic] - spring) / self.f["inertia"][elastic]
                theta[elastic] += dt * w[elastic]
            a = pin.aba(self.model, self.data, q, v, applied)
            load = applied - self.model.armature * a
            if k % INNER == 0:
                rows.append(np.concatenate([theta, w, u]))
            v = v + dt * a
            q = q + dt * v
            keep = np.arange(q.size) != elastic
            theta[keep], w[keep] = q[keep], v[keep]
        table = np.array(rows)
        theta, w, u = np.split(table, 3, axis=1)
        u = u + 0.01 * u.std(axis=0) * np.sin(100 * theta) + 0.03 * u.std(axis=0) * rng.normal(size=u.shape)
        if self.hidden[0] == "gain":
            u[:, self.hidden[1]] *= self.hidden[2]
        shown = theta + 2e-5 * rng.normal(size=u.shape), w + 2e-3 * rng.normal(size=u.shape), u
        return ArmRun(t[::INNER], *shown, "simulated", np.zeros(u.shape[1]))


def model_of(urdf, robot, hidden):
    """Return the model: the URDF with viscous and Coulomb friction, but for the one that is hidden."""
    content = {"plant": "arm", "robot": urdf}
    for i, name in enumerate(robot.names):
        effects = {
            "viscous_friction": {"b": float(FRICTION["viscous"][i])},
            "coulomb_friction": {"mu": float(FRICTION["coulomb"][i])},
        }
        if hidden[:2] == ("coulomb", i):
            del effects["coulomb_friction"]
        content[name] = {"parameters": {"motor_inertia": float(FRICTION["inertia"][i])}, "effects": effects}
    return Model.from_dict(content)


NAMES = {
    "coulomb": ("coulomb_friction",),
    "load_dependent": ("load_dependent_friction",),
    "gain": ("sensor_gain",),
    "compliance": ("compliant_load",),
    "stribeck": ("stribeck_friction",),
    "cubic_viscous": ("cubic_viscous_friction",),
    "payload": ("payload",),
}


def judged(hidden, names, content):
    """Return right, tie, other (right joint, other law), neighbour, missed, silent or false; and false names."""
    said = [entry["effect"] for entry in content["ranking"]]
    said += [f"coupling {a} {b}" for a, b in content["found_couplings"]]
    if hidden[0] == "none":
        return ("silent" if not said else "false"), said
    joint = names[hidden[1]] if hidden[1] >= 0 else ""
    wanted = f"{joint}.{NAMES[hidden[0]][0]}".lstrip(".")
    more = [name for name in said if name != wanted]
    if not said:
        return "missed", more
    ties = [name for entry in content["ranking"] for name in entry["indistinguishable_from"]]
    if said[0] == wanted:
        return "right", more
    if wanted in said or wanted in ties:
        return ("tie" if said[0].startswith(f"{joint}.") else "second"), more
    return ("other" if joint and said[0].startswith(f"{joint}.") else "neighbour"), more


def main(urdf, kinds, count, seed):
    """Score draws of some kinds."""
    robot = read_urdf(urdf)
    for kind in kinds:
        score, extra = {}, 0
        for k in range(count):
            rng = np.random.default_rng([seed, k, sum(map(ord, kind))])
            hidden = draw(kind, rng)
            begun = time.process_time()
            truth = Truth(urdf, robot, rng, hidden)
            known, unseen = truth.run(rng), truth.run(rng)
            middle = time.process_time()
            found = diagnose(model_of(urdf, robot, hidden), [known], [unseen])
            content = diagnosed_json(found, "", "", [])
            key, more = judged(hidden, robot.names, content)
            score[key] = score.get(key, 0) + 1
            extra += bool(more) and key in ("right", "tie")
            payload = content["robot"]["payload"].get("m", {}).get("value")
            spent = f"{middle - begun:.0f} + {time.process_time() - middle:.0f} s"
            print(k, hidden, "->", key, more, [e["effect"] for e in content["ranking"]], payload, spent, flush=True)
        print(
            "SCORE",
            json.dumps({"kind": kind, "seed": seed, "count": count, **score, "false_second": extra}),
            flush=True,
        )


if __name__ == "__main__":
    file, kind, count, seed = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
    main(file, KINDS if kind == "all" else (kind,), count, seed)
