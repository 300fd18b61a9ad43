"""The benchmark of hidden effects asks either estimate by itself."""

from __future__ import annotations

import pytest

from benchmarks.hidden.score import Task, judge, run

CONSTANT_LOAD = 16
"""Its place in the catalogue."""


def test_the_equation_error_estimate_by_itself_names_a_load():
    found = run(Task("catalogue", CONSTANT_LOAD, 1, by="force"))
    assert found["error"] == ""
    assert found["key"] == "catalogue/16/1/force"
    assert judge(found)["right"]


@pytest.mark.slow
def test_the_output_error_estimate_by_itself_names_a_load():
    found = run(Task("catalogue", CONSTANT_LOAD, 1, by="motion"))
    assert judge(found)["right"]
