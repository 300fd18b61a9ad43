"""Sentences on a model that is proposed: faults of its URDF, what is written of the record's, and what is told only."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from signlin_ros.arms.data import gains_of, late_motion
from signlin_ros.arms.distance import BodyDistance
from signlin_ros.arms.heldout import MIN_VALIDATION_ERRORS
from signlin_ros.arms.keys import GAIN, ZERO, Key, SearchResult
from signlin_ros.arms.loaded import more_than
from signlin_ros.arms.search import MIN_COEFFICIENT_ERRORS
from signlin_ros.arms.study import Study
from signlin_ros.arms.warmth import differing
from signlin_ros.names import printed_name
from signlin_ros.robots import Robot
from signlin_ros.robots.inertia import TEN, least_eigenvalue_along, moved

if TYPE_CHECKING:
    from signlin_ros.arms.relief import Relief
    from signlin_ros.arms.verbs import ArmDiagnosis

Array = NDArray[np.float64]
LITTLE = 0.02
"""Part of a joint's residual by which bodies that exist may leave more of its effort before that is told."""


def weigh(prismatic: bool) -> str:
    """Return how the gain of a joint is told whose effort is nearly all friction."""
    return f"a record with a known weight{'' if prismatic else ' off its axis'} (payload: in the file) tells it"


def name_of(study: Study, key: Key) -> str:
    """Return the name of a law: ``elbow_joint.load_dependent_friction``, ``payload``."""
    return f"{study.names[key.at]}.{key.law}" if key.at >= 0 else key.law


def as_good(study: Study, found: SearchResult) -> str:
    """Return the laws that are as good as one, those of other joints by their full names."""
    own = [printed_name(key.law) for key in found.rivals if key.at == found.key.at]
    rivals = [*own, *(name_of(study, key) for key in found.rivals if key.at != found.key.at)]
    return f" (or {', '.join(rivals)}: as good)" if rivals else ""


def study_notes(study: Study) -> list[str]:
    """Return sentences on the records, on friction that differs between them, and on faults of the URDF."""
    in_time = [*lag_notes(study), *settling_notes(study), *warmth_notes(study), *drift_notes(study)]
    return [*study.notes, *in_time, *_loaded_notes(study), *_urdf_notes(study)]


def lag_notes(study: Study) -> list[str]:
    """Return a sentence for each record in which velocities are later than positions, or the other way round."""
    records = {run.source: run for runs in study.runs for run in runs}
    told = [(Path(source).name, said) for source, run in records.items() for said in late_motion(study.names, run)]
    return [f"{name}: {said}" for name, said in told]


def settling_notes(study: Study) -> list[str]:
    """Return a sentence on joints whose friction sets in over a distance after a reversal."""
    if study.settling is None:
        return []
    own = [
        f"{joint.name} over {length:.2g} {joint.position_unit}"
        for joint, length in zip(study.robot.joints, study.settling, strict=True)
        if length > 0.0
    ]
    said = "dry friction sets in after a reversal (presliding, or a gear that winds up)"
    return [f"{said}: {', '.join(own)}; rows until it has are left out, as those at standstill are"]


def payloads_of_records(study: Study) -> list[str]:
    """Return in one sentence, if any do, which records carry how much more than the lightest one."""
    if study.loaded is None:
        return []
    names = [Path(source).name for source in study.loaded.sources]
    return [more_than(study.loaded, names, study.payload_link, MIN_COEFFICIENT_ERRORS)]


def _loaded_notes(study: Study) -> list[str]:
    allowed = "laws are judged beside that; the table is not, as a model has one payload for all records"
    return [f"{said}; {allowed}" for said in payloads_of_records(study)]


def _urdf_notes(study: Study) -> list[str]:
    return [*_without_mass(study.robot), *_too_wide(study.robot), *_impossible(study)]


def _without_mass(robot: Robot) -> list[str]:
    """Return a sentence on joints that carry nothing in the URDF: near nothing is where their bodies are looked for, or
    up to the heaviest where there are others.
    """
    names = [joint.name for joint in robot.joints if joint.pi[0] <= 0.0]
    where = "near nothing, and no payload or load can be told"
    if len(names) < robot.n:
        where = "up to the heaviest one, and take up what a payload or a load beyond them would show"
    return [f"URDF: what {' and '.join(names)} carry has no mass (no <inertial>): bodies are looked for {where}"][
        : len(names)
    ]


def _too_wide(robot: Robot) -> list[str]:
    """Return sentences on bodies whose mass is farther from their centres than the whole robot reaches."""
    masses = {joint.name: joint.pi for joint in robot.joints if joint.pi[0] > 0.0}
    own = {name: moved(pi, np.eye(3), -pi[1:4] / pi[0]) for name, pi in masses.items()}
    radii = {name: float(np.sqrt(max(pi[4] + pi[7] + pi[9], 0.0) / (2.0 * pi[0]))) for name, pi in own.items()}
    centres = sum(float(np.linalg.norm(pi[1:4])) / float(pi[0]) for pi in masses.values())
    reach = centres + sum(float(np.linalg.norm(joint.p)) for joint in robot.joints)
    said = "m of its centre on average, farther than the whole robot reaches: is its inertia in kg·m²?"
    return [f"URDF: the mass of {name} is within {r:.3g} {said}" for name, r in radii.items() if r > reach]


def _impossible(study: Study) -> list[str]:
    return [
        f"URDF: the body that {name} carries cannot exist: its pseudo-inertia has the eigenvalue {value:.2g} kg·m²"
        for name, value in study.robot.inconsistent().items()
    ]


def distance_notes(study: Study, bodies: BodyDistance) -> list[str]:
    """Return a sentence on bodies that are farther from the URDF's than its tolerance says."""
    if not bodies.beyond:
        return []
    said = f"the records ask for others than its tolerance of {study.model.arm.tolerance:.0%} allows"
    how = f"Wald's statistic of {bodies.combinations} combinations is {bodies.statistic:.0f}, by chance up to"
    farthest = f"{bodies.farthest} is farthest, by {bodies.tolerances:.2g} tolerances"
    why = "a load or a tool that is not in the file, a joint's zero that is off, joints whose names are exchanged"
    more = "something that acts like a body, or a tolerance that is too small"
    return [f"bodies of the URDF: {said} ({how} {bodies.most:.0f}; {farthest}): {why}, {more}"]


def of_records(study: Study) -> frozenset[int]:
    """Return the joints of which records have something of their own beyond doubt: friction, or what all carry."""
    if study.loaded is not None:
        return frozenset(range(study.robot.n))
    warm = [] if study.warmth is None else [i for i, _ in differing(study.warmth)]
    return frozenset([*warm, *([] if study.drift is None else [i for i, _ in study.drift.told()])])


def warmth_notes(study: Study) -> list[str]:
    """Return a sentence on joints whose friction differs between records beyond doubt."""
    if study.warmth is None:
        return []
    found, sources = list[str](), [Path(source).name for source in study.warmth.sources]
    for i, sizes in ((i, sizes) for i, sizes in differing(study.warmth) if i not in study.barred):
        ends = dict.fromkeys([int(np.nanargmin(sizes)), int(np.nanargmax(sizes))])
        found.append(f"{study.names[i]} {' to '.join(f'{sizes[k]:.2f} times ({sources[k]})' for k in ends)}")
    said = "friction differs between the records (warm-up?)"
    allowed = "laws are judged beside that; the table is not, as a model has one friction for all records"
    return [f"{said}: {'; '.join(found)}; {allowed}"] if found else []


def drift_notes(study: Study) -> list[str]:
    """Return a sentence on joints whose friction changes within records beyond doubt."""
    if study.drift is None:
        return []
    found, sources = list[str](), [Path(source).name for source in study.drift.sources]
    for i, changes in ((i, changes) for i, changes in study.drift.told() if i not in study.barred):
        k = int(np.nanargmax(np.abs(changes)))
        way = "falls" if changes[k] < 0.0 else "grows"
        found.append(f"{study.names[i]} {way} by {100.0 * abs(changes[k]):.2g} % over {sources[k]}")
    said = "friction changes within the records (warm-up?)"
    allowed = "laws are judged beside that; the table is not, as a model has one friction at all times"
    return [f"{said}: {'; '.join(found)}; {allowed}"] if found else []


def heavier_notes(diagnosis: ArmDiagnosis) -> list[str]:
    """Return a sentence on the body that is heavier, or lighter, than in the URDF beyond doubt, as a whole."""
    study, found = diagnosis.comparison.study, diagnosis.heaviness
    if found is None or not found.told or study.link_side:
        return []
    own = [f"{study.names[i]} {found.factors[i]:.3g} ± {found.errors[i]:.1g} times" for i in found.told]
    others = f" (or {', '.join(own[1:])}: each by itself)" if own[1:] else ""
    instead = ", instead of the payload as well" if diagnosis.payload else ""
    return [f"bodies of the URDF: the records go with what is carried by {own[0]} as heavy as there{others}{instead}"]


def resized_notes(diagnosis: ArmDiagnosis) -> list[str]:
    """Return sentences on the gains that are written, by which all figures of their joints are told."""
    study = diagnosis.comparison.study
    now, found = gains_of(study.model), list[str]()
    for law in (law for law in diagnosis.found if law.key.law == GAIN):
        i = law.key.at
        if law.key in diagnosis.state.known:
            name, unit = study.names[i], study.robot.joints[i].effort_unit
            said = f"{name}: effort.gain is {now[i]:.4g} in the model that is written, and not {_before(law, now):.4g}"
            others = " and ".join(study.names[key.at] for key in law.rivals if key.law == GAIN)
            instead = f"; or the gain of {others} is off instead: a known weight tells" if others else ""
            found.append(f"{said}; all figures of its effort are in {unit} of that gain{instead}")
    return found


def bent(diagnosis: ArmDiagnosis) -> list[str]:
    """Return a sentence on bodies and motors that the rows of the fit ask for and that cannot exist, where those which
    are written cost joints more than a little.

    Each is told where it is so many standard errors beyond as unseen rows need: that it costs something speaks, too.
    """
    study = diagnosis.comparison.study
    written, free, own = _written_rms(diagnosis), diagnosis.estimate.rms, paying(diagnosis)
    cannot = [*_no_bodies(diagnosis), *_no_motors(diagnosis)] if own else []
    asked = [said for _, said in sorted(cannot)]
    if not asked:
        return []
    units = [study.robot.joints[i].effort_unit for i in range(study.robot.n)]
    costs = [f"{written[i]:.3g} {units[i]} of {study.names[i]}'s effort are left, and not {free[i]:.3g}" for i in own]
    cost = f"with bodies and motors that exist {', '.join(costs)}"
    why = "a spring, friction that sets in gradually, a late effort"
    said = f"something acts like that which is not in the model ({why})"
    if diagnosis.relief is not None:
        alone = f"of the rigid body alone, {'; '.join(asked)}; {cost}"
        return [alone, _relieved(study, diagnosis.relief, own)]
    return [f"{'; '.join(asked)}; {cost}: {said}"]


def paying(diagnosis: ArmDiagnosis) -> list[int]:
    """Return the joints of whose effort bodies that exist leave more than a little more than the fit does."""
    study, written, free = diagnosis.comparison.study, _written_rms(diagnosis), diagnosis.estimate.rms
    silent = {law.key.at for law in diagnosis.found if law.key.law == GAIN}
    told = (i for i in range(study.robot.n) if i not in silent | set(study.barred) and study.model.arm.consistent)
    return [i for i in told if written[i] > (1.0 + LITTLE) * free[i]]


def _written_rms(diagnosis: ArmDiagnosis) -> Array:
    """Return what the model leaves of unseen efforts (n,) that has no more than the laws that are named."""
    return diagnosis.comparison.table.model if diagnosis.relief is None else diagnosis.relief.without


def _relieved(study: Study, relief: Relief, own: Sequence[int]) -> str:
    """Return the sentence on what efforts behind the gears show, which is written, and on what is left beside that."""
    springs, gains = list[str](), list[str]()
    for key, value, error in relief.laws:
        name, joint = study.names[key.at], study.robot.joints[key.at]
        if key.law == GAIN:
            gain = f"effort.gain: {gains_of(study.model)[key.at] / (1.0 + value):.3g}"
            gains.append(f"{name}'s effort is {1.0 + value:.3g} ± {error:.1g} times what acts ({gain})")
        else:
            unit = f"{joint.effort_unit}/{joint.position_unit}"
            springs.append(f"{value:.2g} ± {error:.1g} {unit} of {printed_name(key.law)} in {name}")
    left = ", ".join(f"{relief.rms[i]:.3g} {study.robot.joints[i].effort_unit} of {study.names[i]}'s" for i in own)
    said = f"what is measured behind the gears shows {'; '.join([*springs, *gains])}"
    beside = f"beside that, bodies and motors that exist leave {left}"
    return f"{said}: {beside}; the model that is written has that, as it may be the sensor's or the arm's, not a body's"


def _no_bodies(diagnosis: ArmDiagnosis) -> list[tuple[float, str]]:
    """Return what is asked for of bodies and no body has, with how many standard errors it is above nothing."""
    study, estimate = diagnosis.comparison.study, diagnosis.estimate
    bodies = (estimate.pi - study.carried - diagnosis.state.point(estimate)).reshape(-1, TEN)
    found = list[tuple[float, str]]()
    for i, body in enumerate(bodies):
        value, factors = least_eigenvalue_along(body)
        direction = np.zeros((1, len(estimate.theta)))
        direction[0, TEN * i : TEN * (i + 1)] = factors
        error = float(estimate.errors_along(direction)[0])
        if value < -MIN_VALIDATION_ERRORS * error:
            asked = f"the fit asks for a pseudo-inertia with the eigenvalue {value:.2g} ± {error:.1g} kg·m²"
            found.append((value / error, f"{study.names[i]}: {asked}, which no body has"))
    return found


def _no_motors(diagnosis: ArmDiagnosis) -> list[tuple[float, str]]:
    """Return the same of motors' inertias."""
    study, estimate = diagnosis.comparison.study, diagnosis.estimate
    errors = dict(zip(estimate.design.names, estimate.errors().tolist(), strict=True))
    found = list[tuple[float, str]]()
    for i, joint in enumerate(study.robot.joints):
        column = f"{i}.motor_inertia"
        if column in errors and estimate[column] < -MIN_VALIDATION_ERRORS * errors[column]:
            unit = "kg" if joint.prismatic else "kg·m²"
            asked = f"the fit asks for a motor's inertia of {estimate[column]:.2g} ± {errors[column]:.1g} {unit}"
            found.append((estimate[column] / errors[column], f"{joint.name}: {asked}, which no motor has"))
    return found


def _before(law: SearchResult, now: Array) -> float:
    return float(now[law.key.at] * (1.0 + law.values[0]))


def unwritten(diagnosis: ArmDiagnosis) -> list[str]:
    """Return sentences on the laws that are told, and that the model which is written has not: its row lacks them."""
    study, found = diagnosis.comparison.study, list[str]()
    gains, at_motor = gains_of(study.model), study.model.arm_plant.at_motor
    for law in (law for law in diagnosis.found if law.key.at >= 0):
        i, value = law.key.at, float(law.values[0])
        name, joint = study.names[i], study.robot.joints[i]
        if law.key.law == GAIN and law.key not in diagnosis.state.known:
            if at_motor[i]:
                said = f"{name}: its motor turns other joints, too: the model that is written keeps effort.gain"
                gain = (
                    f"{gains[i]:.4g}, and its row is without the gain that was found ({gains[i] / (1.0 + value):.4g})"
                )
                found.append(f"{said} {gain}")
                continue
            said = f"{name}: its effort hardly shows what acts ({1.0 + value:.2g} ± {float(law.errors[0]):.1g} times)"
            found.append(f"{said}: the bodies that are written are fitted to the other joints, and its row lacks that")
        elif law.key.law == ZERO:
            way = f"{'turned' if not joint.prismatic else 'moved'} by {value:.3g} {joint.position_unit}"
            found.append(f"{name}: the URDF that is written has its origin {way}, so that positions stay as recorded")
        elif law.key.law == "compliant_load":
            stiffness = f"{1.0 / value:.2g} {joint.effort_unit}/{joint.position_unit}"
            said = f"{name}: its elastic gear, {stiffness}, is told, and not in the model that is written"
            found.append(f"{said}: its row is that of a model which was fitted without it")
    return found


def payload_alone(diagnosis: ArmDiagnosis) -> str:
    """Return the sentence on a payload beside which nothing was fitted."""
    value, error, unit = diagnosis.payload["m"]
    said = (
        f"payload on {diagnosis.comparison.study.payload_link}: {value:.3g} ± {error:.2g} {unit}, nothing else fitted"
    )
    return f"{said}: it is as right as the model, and as the gains of the efforts"


def weighed_beside(diagnosis: ArmDiagnosis) -> list[str]:
    """Return how a payload is weighed better than beside links whose masses are known to their tolerance only."""
    if diagnosis.only_payload or not diagnosis.payload:
        return []
    study = diagnosis.comparison.study
    said = f"payload: weighed beside links whose masses are known to {study.model.arm.tolerance:.0%}"
    bodies = diagnosis.comparison.bodies
    if bodies.beyond:  # [Birge, Physical Review 40(2), 1932]
        scale = float(np.sqrt(bodies.statistic / bodies.combinations))
        error = f"{scale * diagnosis.payload['m'][1]:.2g} kg"
        said = f"{said}, from which they are farther: as far as they are, its mass is known to {error}"
    better = f"payload: {{on: {study.payload_link}, m: 0, tolerance: {{m: 5}}}}"
    return [f"{said}; a model that was refined without a load weighs it alone, with {better}"]


__all__ = [
    "as_good",
    "bent",
    "distance_notes",
    "drift_notes",
    "heavier_notes",
    "name_of",
    "of_records",
    "payload_alone",
    "payloads_of_records",
    "resized_notes",
    "study_notes",
    "unwritten",
    "warmth_notes",
    "weigh",
    "weighed_beside",
]
