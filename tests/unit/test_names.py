"""Names as they are printed."""

import pytest

from signlin_ros.effects import EFFECTS
from signlin_ros.names import capitalised, printed_name


@pytest.mark.parametrize(
    ("name", "printed"),
    [
        ("bouc_wen_hysteresis", "Bouc-Wen hysteresis"),
        ("load_dependent_stribeck", "load dependent Stribeck"),
        ("wrist_2.lugre_friction", "wrist_2.LuGre friction"),
        ("dahl_presliding+cogging_torque", "Dahl presliding+cogging torque"),
        ("vandahlen_load", "vandahlen load"),
    ],
)
def test_proper_names_have_capitals_and_the_rest_stays(name, printed):
    assert printed_name(name) == printed


def test_no_printed_name_of_the_catalogue_has_an_underscore_or_is_that_of_another():
    printed = [printed_name(name) for name in EFFECTS]
    assert not [name for name in printed if "_" in name]
    assert len(set(printed)) == len(printed)


def test_a_sentence_begins_with_a_capital_and_keeps_those_within():
    assert capitalised("load of a LuGre joint") == "Load of a LuGre joint"
