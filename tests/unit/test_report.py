"""Reports: whole or not at all, nothing loaded from elsewhere, and every section that a review asks for."""

from __future__ import annotations

import base64
import re
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from signlin_ros.diagnosis import add, compare, diagnose
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.plotting import styled
from signlin_ros.records import ModelData
from signlin_ros.report import compare_report, diagnosis_report
from signlin_ros.report.files import write_report
from signlin_ros.report.formulas import _plain_brackets, formula
from signlin_ros.report.page import Code, Fold, Formula, Items, Page, Picture, ReportTable, Section, Text, rendered
from signlin_ros.simulation import simulate

MASS = Model.from_dict(
    {"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.8, "k": 30.0}, "update_period": 0.1}
)
VOID = {"meta", "img", "br", "hr", "link"}
PNG = b"\x89PNG\r\n"


def recorded(model, seed, channels=("displacement", "velocity"), seconds=12, **units):
    """A simulated record with 1 % white noise; ``units`` other than the model's."""
    rng = np.random.default_rng(seed)
    t = np.arange(200 * seconds) / 200
    u = sum(3 * np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28)) for f in rng.uniform(0.1, 2.0, 8))[:, None]
    run = simulate(model, t, u, [0.0] * len(model.states))
    measured = {n: run[n] + 0.01 * run[n].std() * rng.standard_normal(t.size) for n in channels}
    shown = {**model.units, **units}
    return ModelData(t, u, measured, None, model.inputs, model.states, shown, source=f"run_{seed}.csv")


class Reader(HTMLParser):
    """Checks that elements close in order, and collects what they hold."""

    def __init__(self, text):
        super().__init__()
        self.open, self.attributes, self.words = [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.attributes += [(tag, *pair) for pair in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.words.append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


def read(path: Path) -> Reader:
    reader = Reader(path.read_text(encoding="utf-8"))
    for tag, name, value in reader.attributes:
        assert name != "src" or value.startswith("data:image/"), (tag, value)
        assert name != "href" or value.startswith("#"), (tag, value)
        assert tag not in ("script", "link", "iframe")
    assert "url(" not in path.read_text(encoding="utf-8")
    return reader


def sections(reader: Reader) -> list[str]:
    return [value for tag, name, value in reader.attributes if tag == "section" and name == "id"]


def picture(name="waves", title=""):
    with styled(3, 2) as figure:
        figure.subplots().set_title(title)
    return Picture(name, figure, "a caption", "an alternative")


def page(*blocks, title="A <title> & more"):
    return Page(title, ("missing", "badge"), "the lead", [Section("One", blocks), Section("Two", [])], "the foot")


# -------------------------------------------------------------------- blocks


def test_every_text_is_escaped_and_empty_sections_are_left_out():
    bad = "<script>alert('x')</script> & \"quotes\""
    blocks = [
        Text(bad),
        Items([(bad, bad)]),
        ReportTable([bad], [[bad]]),
        Code(bad),
        Formula(None, bad),
        Fold(bad, [Text(bad)]),
    ]
    text, pictures = rendered(page(*blocks, title=bad))
    assert "<script" not in text
    assert pictures == {}
    reader = Reader(text)
    assert sections(reader) == ["one"]
    assert reader.text.count("alert('x')") == 11  # the title is there twice


def test_pictures_are_in_the_page_and_beside_it(tmp_path):
    path = write_report(page(picture()), tmp_path / "report.html")
    (source,) = [v for tag, name, v in read(path).attributes if (tag, name) == ("img", "src")]
    beside = (tmp_path / "report_files" / "waves.png").read_bytes()
    assert beside.startswith(PNG)
    assert base64.b64decode(source.partition(",")[2]) == beside


def test_the_same_report_twice_is_the_same_bytes(tmp_path):
    first, second = (write_report(page(picture()), tmp_path / f"{n}.html").read_bytes() for n in "ab")
    assert first == second


def test_an_interrupted_write_leaves_what_was_there(tmp_path, monkeypatch):
    path = write_report(page(Text("before")), tmp_path / "report.html")
    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_report(page(Text("after")), path)
    assert "before" in path.read_text()
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def interrupted(*_, **__):
    raise KeyboardInterrupt


def test_drawing_that_is_interrupted_writes_nothing(tmp_path):
    broken = picture()
    broken.figure.savefig = interrupted
    with pytest.raises(KeyboardInterrupt):
        write_report(page(picture("first"), broken), tmp_path / "report.html")
    assert not list(tmp_path.iterdir())


def test_where_it_cannot_be_written_is_said(tmp_path):
    with pytest.raises(InputError, match=r"cannot write .*nowhere"):
        write_report(page(Text("x")), tmp_path / "nowhere" / "report.html")


# -------------------------------------------------------------------- formulas


@pytest.mark.parametrize("name", EFFECTS)
def test_every_law_is_set_or_written(name):
    model = Model.load("dc_motor") if "dc_motor" in EFFECTS[name].plants else MASS
    found = formula(name, model)
    assert EFFECTS[name].equation in found.text
    text_only = name.startswith("sensor_") or name in ("backlash", "learned_force")
    assert (found.svg is None) == text_only
    assert found.svg is None or b"<svg" in found.svg


def test_without_sympy_the_law_is_written(monkeypatch):
    monkeypatch.setitem(sys.modules, "sympy", None)
    assert formula("coulomb_friction", MASS) == Formula(None, "Coulomb friction: -mu sign(v)")


def test_brackets_around_fractions_grow():
    assert _plain_brackets(r"a \left(b + \left(c\right)\right)") == "a (b + (c))"
    assert r"\left(" in _plain_brackets(r"\left(\frac{a}{b}\right)")


# -------------------------------------------------------------------- a diagnosis, a comparison


@pytest.fixture(scope="module")
def rubbing():
    """Records of a mass with dry friction, for a model without it."""
    true = MASS.with_effect("coulomb_friction", mu=0.6)
    return [recorded(true, 1)], [recorded(true, 2)]


@pytest.fixture(scope="module")
def added(rubbing):
    return add("coulomb_friction", MASS, *rubbing)


@pytest.mark.slow
def test_report_on_an_effect_that_was_added(added, rubbing, tmp_path):
    command = "signlin add coulomb_friction my <model>.yaml run_1.csv -o new.yaml"
    reader = read(diagnosis_report(added, tmp_path / "out.html", command=command, data=rubbing, model=MASS))
    assert sections(reader) == [
        "what-the-record-shows",
        "the-error--step-by-step",
        "before-and-after",
        "where-the-model-as-given-fails",
        "where-the-proposal-still-fails",
        "parameters",
        "what-else-was-tried",
        "what-this-record-cannot-tell",
        "to-reproduce",
    ]
    text = reader.text
    assert added.sentence in text
    assert command in text
    assert "coulomb_friction.mu" in text
    assert f"{added.parameters['coulomb_friction.mu']}" in text
    assert "run_2.csv" in text
    assert " ".join(added.yaml.split()) in text
    files = {p.name for p in (tmp_path / "out_files").iterdir()}
    assert files >= {"ladder.png", "before_and_after.png", "evidence_coulomb_friction.png", "missing_force.png"}


@pytest.mark.slow
def test_without_records_there_is_still_a_report(added, tmp_path):
    reader = read(diagnosis_report(added, tmp_path / "out.html"))
    assert "before-and-after" not in sections(reader)
    assert {"what-the-record-shows", "parameters"} <= set(sections(reader))


@pytest.mark.slow
def test_parameters_that_were_given_are_told_and_units_are_those_of_the_record(tmp_path):
    true = MASS.with_effect("constant_load", F0=1.0).with_effect("coulomb_friction", mu=0.6)
    base = MASS.with_effect("constant_load", F0=0.4).with_options(frozen=("m",))
    data = [recorded(true, seed, ("displacement",), displacement="rad", force="N·m") for seed in (1, 2)]
    found = add("coulomb_friction", base, data[:1], data[1:])
    assert found.parameters["constant_load.F0"].note.endswith("from its nominal value")
    (line,) = [line for line in found.yaml.splitlines() if "constant_load.F0" in line]
    assert " N·m; was 0.4; " in line
    path = diagnosis_report(found, tmp_path / "out.html", model=base)
    text = path.read_text(encoding="utf-8")
    (held,) = re.findall(r"<tr><td>m</td>.*</tr>", text)
    assert re.findall(r"<td>(.*?)</td>", held) == ["m", "1 kg·m²", "1 kg·m²", "1 kg·m²", "held"]
    (load,) = re.findall(r"<tr><td>constant_load.F0</td>.*</tr>", text)
    assert re.findall(r"<td>(.*?)</td>", load)[1] == "0.4 N·m"
    visited = text[text.index('<section id="what-this-record-cannot-tell">') :]
    assert re.findall(r"<tr><td>(\w+)</td><td>([\w/·]+)</td>", visited)[:3] == [
        ("displacement", "rad"),
        ("velocity", "rad/s"),
        ("force", "N·m"),
    ]
    assert "Save it as proposal.yaml" in text
    assert re.search(r"Fitted Coulomb friction: mu = 0\.\d+ ± 0\.\d+ N·m\.", text)


@pytest.mark.slow
def test_report_on_nothing_missing(tmp_path):
    data = [recorded(MASS, 3, seconds=8)]
    found = diagnose(MASS, data, [recorded(MASS, 4, seconds=8)])
    reader = read(diagnosis_report(found, tmp_path / "out.html", data=(data, None), model=MASS))
    assert found.verdict == "adequate"
    assert ("span", "class", "badge adequate") in reader.attributes
    assert "what-the-record-shows" not in sections(reader)
    assert re.search(r"\d+ other effects, best first", reader.text)


@pytest.mark.slow
def test_report_on_a_comparison(rubbing, tmp_path):
    comparison = compare(MASS, rubbing[1])
    reader = read(compare_report(comparison, tmp_path / "out.html", "signlin compare a.yaml b.csv"))
    assert sections(reader)[:3] == ["scores", "measured-and-predicted", "where-it-fails"]
    assert "times the noise" in reader.text
    assert "signlin compare a.yaml b.csv" in reader.text


def test_evidence_of_an_earlier_report_does_not_stay_beside_a_new_one(tmp_path):
    path = write_report(page(picture("evidence_backlash"), picture("ladder")), tmp_path / "report.html")
    write_report(page(picture("evidence_dahl")), path)
    assert {p.name for p in (tmp_path / "report_files").iterdir()} == {"evidence_dahl.png", "ladder.png"}
