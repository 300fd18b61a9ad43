"""The benchmark of machines drawn by hand: what an answer is worth, and that every machine's folder can be read."""

from __future__ import annotations

from typing import Any

import pytest

from benchmarks.machines.families import FAMILIES, MACHINES
from benchmarks.machines.judge import judge
from benchmarks.machines.rig import Truth
from signlin_ros.checks import check
from signlin_ros.effects import EFFECTS
from signlin_ros.follow.data import load_sides
from signlin_ros.model import Model

PAIR = Truth(
    "friction and a load",
    right=("coulomb_friction+constant_load",),
    part=("stribeck_friction",),
    values={"coulomb_friction.mu": (0.1, 0.2)},
)
NOTHING = Truth("nothing", right=("adequate",))
FOREIGN = Truth("gusts", right=("unexplained", "refused"))


def answer(verdict: str, names: str = "", status: str = "confirmed", **values: float) -> dict[str, Any]:
    """An answer whose last row has some effects, each with its ties behind a slash."""
    entries = []
    for name in names.split():
        first, *ties = name.split("/")
        told = {n: {"value": v} for n, v in values.items()}
        entries.append({"effect": first, "status": status, "indistinguishable_from": ties, "parameters": told})
    return {"verdict": verdict, "ranking": entries, "ladder": [{"effects": [e["effect"] for e in entries]}]}


@pytest.mark.parametrize(
    ("truth", "said", "grade"),
    [
        (PAIR, answer("missing", "constant_load coulomb_friction", mu=0.11), "right"),
        (PAIR, answer("missing", "constant_load coulomb_friction", mu=0.13), "part"),
        (PAIR, answer("missing", "constant_load dahl_presliding/coulomb_friction"), "right"),
        (PAIR, answer("missing", "constant_load a/b/c/coulomb_friction"), "part"),
        (PAIR, answer("missing", "coulomb_friction"), "part"),
        (PAIR, answer("missing", "constant_load coulomb_friction hard_stop"), "part"),
        (PAIR, answer("missing", "stribeck_friction"), "part"),
        (PAIR, answer("missing", "hard_stop"), "wrong"),
        (PAIR, answer("adequate"), "wrong"),
        (PAIR, answer("unexplained", "coulomb_friction", "rejected"), "part"),
        (PAIR, answer("unexplained", "hard_stop", "rejected"), "honest"),
        (PAIR, None, "failed"),
        (NOTHING, answer("adequate"), "right"),
        (NOTHING, answer("missing", "input_delay"), "right"),
        (PAIR, answer("missing", "constant_load coulomb_friction input_delay"), "right"),
        (PAIR, answer("missing", "input_delay"), "wrong"),
        (FOREIGN, answer("missing", "input_delay"), "wrong"),
        (NOTHING, answer("unexplained"), "honest"),
        (NOTHING, answer("missing", "hard_stop"), "wrong"),
        (FOREIGN, answer("unexplained", "hard_stop", "rejected"), "right"),
        (FOREIGN, answer("missing", "hard_stop"), "wrong"),
        (FOREIGN, answer("adequate"), "wrong"),
    ],
)
def test_an_answer_is_worth_what_it_says(truth, said, grade):
    assert judge(truth, said) == grade


def test_a_record_that_is_stopped_is_right_only_where_it_is_to_be():
    assert judge(FOREIGN, None, refused=True) == "right"
    assert judge(PAIR, None, refused=True) == "honest"


def test_every_truth_names_effects_of_the_catalogue():
    words = {"adequate", "unexplained", "refused"}
    for one in MACHINES.values():
        names = {name for told in (*one.truth.right, *one.truth.part) for name in told.split("+")} - words
        assert names | {key.split(".")[0] for key in one.truth.values or ()} <= set(EFFECTS), one.name


def test_machines_have_seeds_of_their_own():
    assert len({one.seed for one in MACHINES.values()}) == len(MACHINES)


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__.rpartition(".")[2])
def test_the_folder_of_a_machine_passes_the_check(family, tmp_path):
    """One machine of each family: of each of the others `benchmarks.machines.run` tells what the check says."""
    name = next(name for name, one in MACHINES.items() if one.make.__module__ == family.__name__)
    model, training, validation = MACHINES[name].write(tmp_path)
    loaded, first, second = load_sides(Model.load(model), [str(training)], [str(validation)], {})
    records, findings = check(loaded, [*first, *(second or ())])
    assert len(records) == 2
    stopped = [f.sentence for f in findings if f.open]
    assert not stopped or "refused" in MACHINES[name].truth.right
