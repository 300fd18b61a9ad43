"""A spring that softens so much that its first estimates run off, from an independent program."""

from __future__ import annotations

from benchmarks.hidden.generator import draw, write
from signlin_ros.diagnosis import diagnose
from signlin_ros.follow.data import load_sides
from signlin_ros.model import Model


def test_a_spring_whose_first_estimates_run_off_is_named(tmp_path):
    """After two steps at the high gain it softened by a third too much: it ran off at the next gain, and was left."""
    one = draw("catalogue", 28, 6)
    folder = write(one, tmp_path)
    known, unseen = ([folder / f"{name}.csv"] for name in ("estimation", "validation"))
    found = diagnose(*load_sides(Model.load(folder / "model.yaml"), known, unseen))
    assert found.verdict == "missing"
    assert [one.effect for one in found.ranking if one.status == "confirmed"] == ["cubic_stiffness"]
    k3 = one.truth["values"]["cubic_stiffness"]["k3"]
    assert abs(found.model.effects["cubic_stiffness"].parameters["k3"] / k3 - 1.0) < 0.03
