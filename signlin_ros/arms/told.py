"""What is told of an arm: JSON, sentences joint by joint, and one for the robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from signlin_ros.arms.coupling import Ratio
from signlin_ros.arms.distance import BodyDistance
from signlin_ros.arms.foretold import foretold_json, forward_json, forward_text, speed_unit
from signlin_ros.arms.keys import DELAY, GAIN, SEEN_ELSEWHERE, TILT, ZERO, SearchResult
from signlin_ros.arms.laws import BY_EFFECT
from signlin_ros.arms.loaded import heavier_records
from signlin_ros.arms.notes import (
    as_good,
    bent,
    distance_notes,
    heavier_notes,
    name_of,
    of_records,
    payload_alone,
    payloads_of_records,
    resized_notes,
    study_notes,
    unwritten,
    weigh,
    weighed_beside,
)
from signlin_ros.arms.proposal import basic_of
from signlin_ros.arms.search import MIN_COEFFICIENT_ERRORS
from signlin_ros.arms.study import Study, unseen_noise
from signlin_ros.arms.verbs import LINEAR_PARAMETERS, ArmComparison, ArmDiagnosis, MissingLaw
from signlin_ros.effects import find_effect
from signlin_ros.names import printed_name
from signlin_ros.plants.joint import joint_plant
from signlin_ros.recording.trace import resolve_unit

MAX_LITTLE_SHARE = 0.05
"""Part of its effort from which on what a joint leaves is more than little."""
MAX_NOISE_RATIO = 2.0
"""Times its noise up to which what a joint leaves may be that."""


def compared_json(comparison: ArmComparison, source: str, data: list[str]) -> dict[str, Any]:
    """Return the JSON of `compare` (schemas/arm_compare.json)."""
    study = comparison.study
    return {
        "joints": _joints(comparison, {}),
        "robot": {"payload": {}, "gains": {}, "couplings": _known_couplings(study)},
        "inverse": _inverse(comparison),
        "band_hz": study.band,
        "urdf": _urdf(study, comparison.bodies),
        "model": source,
        "data": data,
        "samples": sum(len(run) for runs in study.runs for run in runs),
        "notes": [*study_notes(study), *distance_notes(study, comparison.bodies)],
    }


def diagnosed_json(diagnosis: ArmDiagnosis, text: str, source: str, data: list[str]) -> dict[str, Any]:
    """Return the JSON of `diagnose`, `add` and `refine` (schemas/arm_diagnose.json)."""
    study = diagnosis.comparison.study
    named = effects_named(diagnosis)
    content = compared_json(diagnosis.comparison, source, data)
    content["joints"] = _joints(diagnosis.comparison, named)
    for i, name in enumerate(study.names):
        content["joints"][name]["cannot_tell"] += _too_small(diagnosis, i)
        if diagnosis.ahead is not None:
            content["joints"][name]["forward"] = foretold_json(diagnosis.ahead, i, speed_unit(study, i))
    payload = {n: {"value": v, "std": e, "unit": u} for n, (v, e, u) in diagnosis.payload.items()}
    gains = {
        study.names[f.key.at]: _value(float(f.values[0]), float(f.errors[0]), "-")
        for f in diagnosis.found
        if f.key.law == GAIN
    }
    couplings = _known_couplings(study)
    couplings += [list(pair) for pair in diagnosis.couplings if not any(set(pair) <= set(known) for known in couplings)]
    content["robot"] = {"payload": payload, "gains": gains, "couplings": couplings}
    content["robot"] |= {**_delays(diagnosis), **_zeros(diagnosis), **_ratios(diagnosis)}
    content["robot"] |= {"tilt": _tilt(diagnosis)} if _tilt(diagnosis) else {}
    content["robot"] |= _payloads_of_records(study)
    content["notes"] += [
        *heavier_notes(diagnosis),
        *resized_notes(diagnosis),
        *unwritten(diagnosis),
        *weighed_beside(diagnosis),
        *bent(diagnosis),
    ]
    return {
        "verdict": verdict(diagnosis),
        **content,
        "ranking": _ranking(diagnosis),
        "found_couplings": [list(pair) for pair in diagnosis.couplings],
        "model": text,
        "range": _range(study),
    }


def effects_named(diagnosis: ArmDiagnosis) -> dict[int, list[str]]:
    """Return the effects that are named in each joint; delays are no effects."""
    named: dict[int, list[str]] = {}
    for missing in diagnosis.missing:
        named.setdefault(missing.joint, []).append(missing.effect)
    for found in diagnosis.found:
        if found.key.at >= 0 and found.key.law != DELAY:
            named.setdefault(found.key.at, []).append(found.key.law)
    return named


def verdict(diagnosis: ArmDiagnosis) -> str:
    """Return missing, adequate or unexplained."""
    if diagnosis.found or diagnosis.missing or diagnosis.couplings:
        return "missing"
    if diagnosis.only_payload and diagnosis.payload:
        value, error, _ = diagnosis.payload["m"]
        return "missing" if value > 3.0 * error else "adequate"
    return "unexplained" if any(_unexplained(diagnosis.comparison)) else "adequate"


def _unexplained(comparison: ArmComparison) -> list[bool]:
    """Tell of each joint whether more than noise and little is left of unseen rows."""
    study, left = comparison.study, np.minimum(comparison.table.model, comparison.table.basic)
    if comparison.matched is not None:
        left = np.minimum(left, comparison.matched)
    efforts, noise = study.new.by_joint(study.new.y), unseen_noise(study)
    more = (left > MAX_LITTLE_SHARE * efforts) & (left > MAX_NOISE_RATIO * noise)
    return [bool(m) and i not in study.barred and i not in study.link_side for i, m in enumerate(more)]


# ---------------------------------------------------------------- pieces of JSON


def _joints(comparison: ArmComparison, named: Mapping[int, list[str]]) -> dict[str, Any]:
    study, table = comparison.study, comparison.table
    efforts, noise = study.new.by_joint(study.new.y), unseen_noise(study)
    found = {}
    for i, name in enumerate(study.names):
        why = [study.barred[i]] if i in study.barred else []
        why += [study.link_side[i]] if i in study.link_side else []
        own = basic_of(study, comparison.all_data, i, study.names)
        joint = study.robot.joints[i]
        v = f"{joint.position_unit}/s"
        units = {
            "viscous": f"{joint.effort_unit}·s/{joint.position_unit}",
            "coulomb": joint.effort_unit,
            "offset": joint.effort_unit,
            "motor_inertia": "kg" if joint.prismatic else "kg·m²",
        }
        found[name] = {
            "unit": joint.effort_unit,
            "band_hz": study.band,
            **{row: _finite(getattr(table, row)[i]) for row in ("as_given", "rigid", "basic", "model")},
            "effort": _finite(efforts[i]),
            "noise": float(noise[i]),
            "effects": named.get(i, []),
            "cannot_tell": [*why, *_cannot(study, i)],
            "basic_parameters": {n: {"value": value, "unit": units[n]} for n, value in own.items()},
            "speed": {"value": max(float(np.abs(p.v[:, i]).max()) for p in study.rows.pieces), "unit": v},
        }
    return found


def _cannot(study: Study, i: int) -> list[str]:
    """Return sentences on the limits of such records for a joint."""
    if i in study.barred:
        return []
    found = []
    joint = study.robot.joints[i]
    if joint.parent < 0 and not joint.prismatic:
        found.append("the inertia of its motor from that of its own link about the same axis")
    if joint.prismatic and not _turned(study, i):
        found.append("the mass that it moves from its motor's inertia and a constant load along it")
    return found


def _turned(study: Study, i: int) -> bool:
    """Tell whether a joint that turns carries a joint, which then stands otherwise towards gravity."""
    parent = study.robot.joints[i].parent
    return parent >= 0 and (not study.robot.joints[parent].prismatic or _turned(study, parent))


def _too_small(diagnosis: ArmDiagnosis, i: int) -> list[str]:
    """Return which wrong gain and which elasticity of a joint these records would not show."""
    sizes = {key.law: size for key, size in diagnosis.detectable.items() if key.at == i}
    study = diagnosis.comparison.study
    joint, found = study.robot.joints[i], []
    if "sensor_gain" in sizes:
        share = sizes["sensor_gain"]
        why = (
            f"nearly all of it is friction, which scales along; {weigh(joint.prismatic)}"
            if share >= 1.0
            else f"by less than {100 * share:.2g} %"
        )
        found.append(f"whether the gain of its effort is off, {why}{_scaled_along(diagnosis, i, share)}")
    stiffness = 1.0 / sizes.get("compliant_load", np.inf)
    if stiffness > 0.0:
        unit = f"{joint.effort_unit}/{joint.position_unit}"
        found.append(f"whether its gear is elastic, if it is stiffer than {stiffness:.2g} {unit}")
    if ZERO in sizes:
        most, much = sizes[ZERO], float(np.inf) if joint.prismatic else 1.0
        less = f", by less than {most:.2g} {joint.position_unit}"
        found.append(f"whether the zero of its encoder is off{less if most < much else HARDLY}")
    return [*found, *_too_light(diagnosis, i)]


def _too_light(diagnosis: ArmDiagnosis, i: int) -> list[str]:
    """Return by how much heavier than in the URDF a joint's body may be and these records would not show it."""
    heavy, study = diagnosis.heaviness, diagnosis.comparison.study
    if heavy is None or i in study.barred or i in study.link_side or i in heavy.told or np.isnan(heavy.errors[i]):
        return []
    most, said = float(heavy.smallest[i]), "whether what it carries is heavier than the URDF says"
    why = (
        f"by less than {100.0 * most:.0f} %"
        if most < FAR
        else "as its motor, a constant load or other bodies take it up"
    )
    return [f"{said}, {why}"]


FAR = 3.0
"""Times its mass from which on it is not told at all that a body is heavier."""


def _scaled_along(diagnosis: ArmDiagnosis, i: int, share: float) -> str:
    """Return what a joint's friction is beside the file's, where all of it differs beyond doubt, one way, and by no
    more than a gain that would not be seen: the record does not say which of the two it is.
    """
    study, estimate = diagnosis.comparison.study, diagnosis.estimate
    errors = dict(zip(estimate.design.names, estimate.errors().tolist(), strict=True))
    sizes = []
    for effect, linear in LINEAR_PARAMETERS.items():
        use, column = study.model.effects.get(f"{study.names[i]}.{effect}"), f"{i}.{effect}.{linear}"
        if use is None or column not in errors or not use.parameters[linear]:
            return ""
        sizes.append((estimate[column] / use.parameters[linear], errors[column] / use.parameters[linear]))
    away = [size - 1.0 for size, _ in sizes]
    beyond = all(abs(size - 1.0) > MIN_COEFFICIENT_ERRORS * error for size, error in sizes)
    if not beyond or np.ptp(np.sign(away)) or max(map(abs, away)) > share:
        return ""
    said = " and ".join(f"{size:.2f}" for size, _ in sizes)
    return f"; its Coulomb and viscous friction are {said} times the file's, and such a gain would show as that, too"


def _value(value: float, error: float, unit: str) -> dict[str, Any]:
    return {"value": value, "std": error, "unit": unit}


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _inverse(comparison: ArmComparison) -> dict[str, Any]:
    study, own = comparison.study, comparison.table.model
    efforts = study.new.by_joint(study.new.y)
    return {
        f"{name}.effort": {
            "unit": study.robot.joints[i].effort_unit,
            "rmse": _finite(own[i]),
            "relative_error_percent": _finite(100.0 * own[i] / efforts[i]) if efforts[i] > 0 else None,
            "cutoff_hz": study.band,
        }
        for i, name in enumerate(study.names)
    }


def _known_couplings(study: Study) -> list[list[str]]:
    return [list(coupling.joints) for _, coupling in study.model.arm.couplings]


def _delays(diagnosis: ArmDiagnosis) -> dict[str, Any]:
    """Return by how many seconds efforts are recorded later than the motion, by joint, or of all."""
    late = {f.key.at: f for f in diagnosis.found if f.key.law == DELAY}
    names = {-1: "all", **dict(enumerate(diagnosis.comparison.study.names))}
    found = {names[at]: _value(float(f.values[0]), float(f.errors[0]), "s") for at, f in late.items()}
    return {"delays": found} if found else {}


def _zeros(diagnosis: ArmDiagnosis) -> dict[str, Any]:
    """Return how much more than the angle (or the way) encoders show, by joint."""
    study = diagnosis.comparison.study
    found = {
        study.names[f.key.at]: _value(
            -float(f.values[0]), float(f.errors[0]), study.robot.joints[f.key.at].position_unit
        )
        for f in diagnosis.found
        if f.key.law == ZERO
    }
    return {"zeros": found} if found else {}


def _payloads_of_records(study: Study) -> dict[str, Any]:
    """Return by how many kg records carry more than the lightest one, by record."""
    found = study.loaded
    if found is None:
        return {}
    heavier = heavier_records(found, MIN_COEFFICIENT_ERRORS)
    return {
        "payloads": {found.sources[k]: _value(float(found.masses[k]), float(found.errors[k]), "kg") for k in heavier}
    }


def _tilt(diagnosis: ArmDiagnosis) -> dict[str, Any]:
    for found in diagnosis.found:
        if found.key.law == TILT:
            pairs = zip(("x", "y"), found.values, found.errors, strict=True)
            return {name: _value(float(v), float(e), "rad") for name, v, e in pairs}
    return {}


def _urdf(study: Study, bodies: BodyDistance) -> dict[str, Any]:
    distance = {
        "statistic": bodies.statistic,
        "by_chance": bodies.most,
        "combinations": bodies.combinations,
        "farthest": bodies.farthest,
        "tolerances": bodies.tolerances,
    }
    wrong = study.robot.inconsistent()
    return {"consistent": not wrong, "inconsistent": wrong, "distance": distance}


def _ranking(diagnosis: ArmDiagnosis) -> list[dict[str, Any]]:
    """Return the entries of all laws, each with what short forward simulations say of it."""
    study = diagnosis.comparison.study
    entries = [_entry(study, f) for f in diagnosis.found] + [_left_out(study, m) for m in diagnosis.missing]
    joints = [f.key.at for f in diagnosis.found] + [m.joint for m in diagnosis.missing]
    witnesses = diagnosis.witnesses or (None,) * len(entries)
    for entry, at, witness in zip(entries, joints, witnesses, strict=True):
        unit = speed_unit(study, at)
        entry["why"] += forward_text(witness, unit)
        entry["forward"] = forward_json(witness, unit)
        heavier = entry["effect"] == "payload" and diagnosis.heaviness is not None and bool(diagnosis.heaviness.told)
        if heavier or (witness is not None and witness.says == "in question"):
            entry["status"] = "ambiguous"
    return entries


def _entry(study: Study, found: SearchResult) -> dict[str, Any]:
    rivals = [name_of(study, key) for key in found.rivals]
    return {
        "effect": name_of(study, found.key),
        "status": "ambiguous" if rivals else "confirmed",
        "parameters": parameters(study, found),
        "validation": {
            f"{name}.effort": {"before": _finite(found.before[i]), "after": _finite(found.after[i])}
            for i, name in enumerate(study.names)
        },
        "indistinguishable_from": rivals,
        "why": sentence(study, found),
    }


def _left_out(study: Study, missing: MissingLaw) -> dict[str, Any]:
    name, i = study.names[missing.joint], missing.joint
    unit = _unit(study, i, missing.effect, "mu" if missing.effect == "coulomb_friction" else "b")
    linear = "mu" if missing.effect == "coulomb_friction" else "b"
    return {
        "effect": f"{name}.{missing.effect}",
        "status": "confirmed",
        "parameters": {linear: _value(missing.value, missing.error, unit)},
        "validation": {
            f"{other}.effort": {"before": _finite(missing.before[k]), "after": _finite(missing.after[k])}
            for k, other in enumerate(study.names)
        },
        "indistinguishable_from": [],
        "why": f"{printed_name(missing.effect)} of {missing.value:.3g} {unit}, which the file leaves out: "
        + _fall(missing.before[i], missing.after[i], study, i),
    }


def parameters(study: Study, found: SearchResult) -> dict[str, Any]:
    """Return the parameters of a law with standard errors and units."""
    key, value, error = found.key, float(found.values[0]), float(found.errors[0])
    if key.law == GAIN:
        return {"gain": _value(1.0 + value, error, "-")}
    if key.law == DELAY:
        return {"delay": _value(value, error, "s")}
    if key.law == ZERO:
        return {"offset": _value(-value, error, study.robot.joints[key.at].position_unit)}
    if key.law == "compliant_load":
        unit = "N·m/rad" if not study.robot.joints[key.at].prismatic else "N/m"
        return {"k": _value(1.0 / value, error / value**2, unit)}
    if key.at < 0:
        names = ("m", "mx", "my", "mz") if key.law == "payload" else ("x", "y")
        units = ("kg", "kg·m", "kg·m", "kg·m") if key.law == "payload" else ("rad", "rad")
        rows = zip(names, found.values, found.errors, units, strict=True)
        return {n: _value(float(v), float(e), u) for n, v, e, u in rows}
    law = BY_EFFECT[key.law]
    content = {law.linear: _value(value, error, _unit(study, key.at, key.law, law.linear))}
    if law.shape:
        content[law.shape] = _value(key.shape, 0.0, _unit(study, key.at, key.law, law.shape))
    return content


def _unit(study: Study, i: int, effect: str, name: str) -> str:
    i = i if i < len(study.names) else 0
    return resolve_unit(find_effect(effect, "effects").pars()[name].unit, joint_plant(study.robot.joints[i].prismatic))


def _fall(before: float, after: float, study: Study, i: int) -> str:
    unit = study.robot.joints[i].effort_unit
    return f"validation error {before:.3g} -> {after:.3g} {unit} ({study.band:g} Hz)"


def sentence(study: Study, found: SearchResult) -> str:
    """Return the sentence on a law, its size and its gain."""
    key, value = found.key, float(found.values[0])
    stiffness = _unit(study, key.at, "linear_stiffness", "k")
    elsewhere = key.at < 0 or key.law in (*SEEN_ELSEWHERE, ZERO)
    i = int(np.nanargmax(np.log(found.before / found.after))) if elsewhere else key.at
    whose = f"the effort of {study.names[key.at]} is" if key.at >= 0 else "all efforts are"
    what = {
        DELAY: f"{whose} recorded {1e3 * abs(value):.2g} ± {1e3 * float(found.errors[0]):.1g} ms "
        f"{'later' if value > 0 else 'earlier'} than the motion",
        ZERO: f"the zero of its encoder is off: it shows {abs(value):.3g} ± {float(found.errors[0]):.1g} "
        f"{study.robot.joints[key.at].position_unit} {'less' if value > 0 else 'more'} than the URDF's angle",
        "load_dependent_friction": f"load-dependent friction, {100 * value:.2g} % of the load",
        "stribeck_friction": f"dry friction that falls with speed (Stribeck), over {key.shape:.2g}",
        "cubic_viscous_friction": f"viscous friction that grows {'faster' if value > 0 else 'slower'} than speed",
        "power_law_friction": f"friction that grows with the power {key.shape:.2g} of speed",
        "asymmetric_viscous_friction": "viscous friction that differs by direction",
        "linear_stiffness": f"a spring acts on it, {value:.2g} {stiffness}",
        "sensor_gain": f"the gain of its effort is off: it shows {1 + value:.3g} times what acts",
        "compliant_load": f"its gear or belt is elastic, about {1 / value:.2g} {stiffness}" if value else "",
        "payload": f"a payload of {value:.3g} ± {float(found.errors[0]):.2g} kg on {study.payload_link}",
        TILT: "the base is tilted: gravity comes from elsewhere",
    }[key.law]
    where = "" if key.at == i else f"{study.names[i]}: "
    return f"{what}; {where}{_fall(found.before[i], found.after[i], study, i)}"


def _range(study: Study) -> dict[str, list[float]]:
    found = {}
    for i, name in enumerate(study.names):
        for quantity, values in (("position", "q"), ("velocity", "v")):
            all_ = np.concatenate([getattr(piece, values)[:, i] for piece in study.rows.pieces])
            found[f"{name}.{quantity}"] = [float(all_.min()), float(all_.max())]
    return found


# ---------------------------------------------------------------- sentences


def sentences(diagnosis: ArmDiagnosis) -> list[str]:
    """Return one sentence for each joint, and one for the robot."""
    study, table = diagnosis.comparison.study, diagnosis.comparison.table
    lines, left, own = [], _unexplained(diagnosis.comparison), of_records(study)
    efforts, told = study.new.by_joint(study.new.y), _whys(diagnosis)
    for i, name in enumerate(study.names):
        unit = study.robot.joints[i].effort_unit
        said = [why for at, why in told if at == i]
        if i in study.barred or i in study.link_side:
            said = [study.barred.get(i) or study.link_side[i]]
        elif not said:
            rest = f"{table.model[i]:.3g} {unit} of {efforts[i]:.3g} are left"
            if diagnosis.comparison.matched is not None and i in own:
                rest += f" ({diagnosis.comparison.matched[i]:.3g} beside what is that record's own)"
            said = [f"nothing listed is missing; {rest}" + (", unexplained" if left[i] else "")]
        lines.append(f"{name}: {'; '.join(said)}")
    return [*lines, f"robot: {_robot(diagnosis, told)}"]


def _whys(diagnosis: ArmDiagnosis) -> list[tuple[int, str]]:
    """Return the place (-1: the robot, all delays) and the sentence of every law, left out ones of the file first."""
    entries, found, study = _ranking(diagnosis), diagnosis.found, diagnosis.comparison.study
    places = [-1 if f.key.law == DELAY else f.key.at for f in found]
    said = [(at, e["why"] + as_good(study, f)) for at, f, e in zip(places, found, entries, strict=False)]
    missing = [(m.joint, e["why"]) for m, e in zip(diagnosis.missing, entries[len(found) :], strict=True)]
    return [*missing, *said]


def _robot(diagnosis: ArmDiagnosis, told: Sequence[tuple[int, str]]) -> str:
    said = [f"{a} and {b} are coupled: {_turning(diagnosis, a, b)}" for a, b in diagnosis.couplings]
    said += [why for at, why in told if at < 0]
    if diagnosis.only_payload and diagnosis.payload:
        said.append(payload_alone(diagnosis))
    found, own = {f.key.law for f in diagnosis.found}, payloads_of_records(diagnosis.comparison.study)
    wrong = "".join(f"{what}, " for law, what in ((GAIN, "wrong gain"), (ZERO, "wrong zero")) if law not in found)
    said = own + (said or [f"no {'other ' if own else ''}payload, {wrong}delay, tilt or coupling is seen"])
    far = ["its bodies are not those of the URDF (see the notes)"] if diagnosis.comparison.bodies.beyond else []
    return "; ".join([*said, *far])


def _turning(diagnosis: ArmDiagnosis, a: str, b: str) -> str:
    """Return which motors turn with both joints of a coupling, how much, and whose efforts are recorded."""
    study = diagnosis.comparison.study
    i, j = (study.names.index(name) for name in (a, b))
    own = [ratio for ratio in diagnosis.ratios if ratio.pair == (i, j)]
    said = "both motors turn with both" if len(own) > 1 else "one motor turns with both"
    said += "".join(f"; {_ratio_said(study, ratio)}" for ratio in own if not ratio.whole)
    return f"{said}, and their efforts are the motors'" if study.model.arm_plant.at_motor[i] else said


def _ratio_said(study: Study, ratio: Ratio) -> str:
    """Return how much a motor turns with another joint, in what it turns with its own."""
    motor, joint = study.names[ratio.motor], study.names[ratio.joint]
    return f"that of {motor} {ratio.value:.3g} ± {ratio.error:.1g} times as much with {joint} as with its own joint"


def _ratios(diagnosis: ArmDiagnosis) -> dict[str, Any]:
    """Return how much motors turn with another joint than their own, in what they turn with that."""
    names = diagnosis.comparison.study.names
    found = [
        {"motor": names[r.motor], "joint": names[r.joint], "ratio": _value(r.value, r.error, "-")}
        for r in diagnosis.ratios
    ]
    return {"ratios": found} if found else {}


HARDLY = ", as efforts hardly depend on its position"
"""Why a zero is not told at all: a turn by a radian or more would not show."""
CANNOT = (
    "whether all efforts are off by one factor: every residual scales with it (weigh a known payload)",
    "friction at standstill: rows in which a joint stands still are left out",
)
"""What no record of this kind tells."""


__all__ = [
    "CANNOT",
    "compared_json",
    "diagnosed_json",
    "effects_named",
    "name_of",
    "sentences",
    "verdict",
]
