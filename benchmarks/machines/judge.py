"""What an answer about a machine is worth."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any

from benchmarks.hidden.score import MOST_TIED, _tie
from benchmarks.machines.rig import Truth

GRADES = ("right", "part", "honest", "wrong", "failed")


def judge(truth: Truth, answer: Mapping[str, Any] | None, refused: bool = False) -> str:
    """Return the grade of the JSON of a diagnosis; ``refused``: the check stopped the record, None: nothing came.

    right: what is confirmed is one of the right sets (of a tie of at most three any member), and the values told of it
    are within their tolerances. part: a true name is confirmed or explains a part, or a right set has a wrong value.
    honest: nothing is named, though something is hidden, or nothing is found adequate where nothing is. wrong: all
    that is confirmed is false, or a model that lacks something is called adequate. failed: an error, or no answer.
    """
    if refused or answer is None:
        return ("right" if "refused" in truth.right else "honest") if refused else "failed"
    named = proposed(answer)
    known = {name for one in (*truth.right, *truth.part) for name in one.split("+")}
    if answer["verdict"] != "missing":
        if answer["verdict"] in truth.right:
            return "right"
        if answer["verdict"] == "adequate":
            return "wrong"
        return "part" if known & set(last_row(answer)) else "honest"
    sets = {frozenset(one.split("+")) - {"adequate"} for one in truth.right if one not in ("unexplained", "refused")}
    choices = (frozenset(one) for one in product(*named) if len(set(one)) == len(one))
    fits = any(one in sets or one - set(truth.also) in sets for one in choices)
    if fits and all(within for _, _, _, within in values(truth, answer)):
        return "right"
    return "part" if known & set().union(*named) else "wrong"


def proposed(answer: Mapping[str, Any]) -> list[set[str]]:
    """Return for each effect of the proposal the effects that it may stand for."""
    final = last_row(answer) if answer["verdict"] == "missing" else []
    entries = {e["effect"]: e for e in answer["ranking"]}
    ties = [_tie(entries[name]) if name in entries else {name} for name in final]
    return [tie if len(tie) <= MOST_TIED else {name} for name, tie in zip(final, ties, strict=True)]


def last_row(answer: Mapping[str, Any]) -> list[str]:
    """Return the effects of the ladder's last row: what is proposed, or told to explain a part."""
    return list(answer["ladder"][-1]["effects"]) if answer["ladder"] else []


def values(truth: Truth, answer: Mapping[str, Any]) -> list[tuple[str, float, float, bool]]:
    """Return name, value, true value, and whether it is within its tolerance, of what is named and known."""
    found = []
    for entry in answer["ranking"]:
        for name, told in entry["parameters"].items():
            key = f"{entry['effect']}.{name}"
            if truth.values and key in truth.values and told.get("value") is not None:
                true, tolerance = truth.values[key]
                value = float(told["value"])
                found.append((key, value, true, abs(value - true) <= tolerance * abs(true)))
    return found
