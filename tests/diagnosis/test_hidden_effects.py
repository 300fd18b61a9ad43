"""Records with a hidden effect: the name, or the refusal. Simulated by programs that share no code with ours."""

from __future__ import annotations

import json
import os
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.hidden.generator import draw, write
from signlin_ros.diagnosis import add, diagnose, refine
from signlin_ros.errors import InputError, ModelError, RecordError
from signlin_ros.follow.data import load_records
from signlin_ros.model import Model

DATA = Path(os.environ.get("SIGNLIN_DATA", "../shared/data"))
SHARED = DATA / "hidden_effects"
SEED = 1


def records(folder: Path):
    model = Model.load(folder / "model.yaml")
    model, data = load_records(model, [str(folder / f"{part}.csv") for part in ("estimation", "validation")])
    return model, data[:1], data[1:]


def halved(model, data, unseen):
    """Return a model and the first halves of its records: 8 s tell as much of a drive as 16."""
    return model, *([one.part(0, one.t.size // 2) for one in part] for part in (data, unseen))


def risen(ladder: list[dict[str, Any]], alike: float = 1.01) -> list[str]:
    """Return the rows of a table that are worse with an effect than without it, so that it shows: step by step."""
    rows = []
    for before, after in pairwise(ladder):
        first, last = (step["validation"] for step in (before, after))
        rows += [n for n in first if n != "score" and last[n]["rmse"] > alike * first[n]["rmse"]]
        force = [step["missing_force_percent"] for step in (before, after)]
        rows += ["missing force"] if None not in force and force[1] > alike * force[0] else []
    return rows


def named(found) -> set[str]:
    return set(found.ladder[-1].effects) if found.verdict == "missing" else set()


def truths():
    if not (SHARED / "truth.json").exists():
        return []
    return json.loads((SHARED / "truth.json").read_text(encoding="utf-8"))


KNOWN = {"motor_j": pytest.mark.limit("Coulomb friction is named in place of Stribeck's curve")}


@pytest.mark.skipif(not SHARED.exists(), reason=f"no records in {SHARED}; set SIGNLIN_DATA")
@pytest.mark.parametrize("truth", [pytest.param(t, id=t["name"], marks=KNOWN.get(t["name"], ())) for t in truths()])
def test_shared_records(truth):
    found = diagnose(*halved(*records(SHARED / truth["name"])))
    hidden = set(truth["hidden"])
    if hidden == {"none"}:
        assert found.verdict == "adequate"
    elif any("unlisted" in h for h in hidden):
        assert found.verdict == "unexplained"
    else:
        assert found.verdict == "missing"
        assert named(found) == hidden
    assert found.model.input_hold == "forward"  # of commands, whatever is hidden
    assert not [note for note in found.notes if "input_hold" in note]
    if found.verdict == "missing" or any(e.status == "confirmed" for e in found.ranking):
        assert risen([row.to_json() for row in found.ladder]) == []
    noise = truth["noise_sigma"]["validation"]
    if found.verdict != "unexplained":
        worst = max(s.rmse / noise[c] for c, s in found.ladder[-1].validation.channels.items() if noise[c] > 1e-4)
        assert worst < 1.3


@pytest.mark.parametrize(
    ("group", "index"),
    [
        ("single", 1),
        ("weak", 3),
        ("none_coloured", 4),
    ],
)
def test_drawn_records(group, index, tmp_path):
    record = draw(group, index, SEED)
    given = records(write(record, tmp_path / record.name))
    found = diagnose(*(given if group == "weak" else halved(*given)))
    hidden = {h for h in record.truth["hidden"] if h != "none"}
    entry = next((e for e in found.ranking if e.effect in found.ladder[-1].effects), None)
    tied = set(entry.indistinguishable_from) if entry and len(entry.indistinguishable_from) < 3 else set()
    assert hidden <= named(found) | tied
    assert bool(named(found)) == bool(hidden)


@pytest.fixture(scope="module")
def coulomb(tmp_path_factory):
    record = draw("single", 1, SEED)
    return records(write(record, tmp_path_factory.mktemp("coulomb") / record.name))


def test_add_refine_and_the_file_that_comes_out(coulomb, tmp_path):
    model, data, unseen = coulomb
    found = refine(model, data, unseen)
    path = tmp_path / "new.yaml"
    path.write_text(found.yaml, encoding="utf-8")
    again = Model.load(path)
    assert again.effects.keys() == found.model.effects.keys()
    assert np.allclose(again.p, found.model.p)
    assert "fitted" in found.yaml
    assert "stopped after" in found.notes[-1]
    wrong = add("cubic_stiffness", model, data, unseen)
    assert wrong.ladder[-1].effects == ("cubic_stiffness",)
    right = add(found.ladder[-1].effects[0], model, data, unseen)
    worst = [max(s.rmse for s in d.ladder[-1].validation.channels.values()) for d in (wrong, right)]
    assert worst[1] < worst[0]


def test_bad_requests(coulomb):
    model, data, unseen = coulomb
    with pytest.raises(ModelError, match="unknown effect"):
        add("coulumb_friction", model, data, unseen)
    with pytest.raises(InputError, match="cannot be added"):
        add("coulomb_friction", model.with_effect("coulomb_friction", mu=0.1), data, unseen)
    with pytest.raises(RecordError, match="at least"):
        diagnose(model, data[0].part(0, 20))
