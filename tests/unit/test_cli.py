"""The command line: what it prints, how it refuses, what it costs to ask for help."""

import errno
import html
import json
import os
import resource
import subprocess
import sys
from importlib import resources
from types import SimpleNamespace

import jsonschema
import numpy as np
import pytest

import signlin_ros.figures
import signlin_ros.linearization
import signlin_ros.simulation
from signlin_ros import cli
from signlin_ros.effects import EFFECTS
from signlin_ros.errors import InputError, MissingExtraError
from signlin_ros.linearization import METHODS, linearize
from signlin_ros.model import Model
from signlin_ros.plants import PLANTS

DATA = "t,voltage\n" + "".join(f"{k / 100},{2.0 if k < 50 else 0.0}\n" for k in range(101))


@pytest.fixture
def run(capsys):
    """Run the command line in this process; returns code, standard output, standard error."""

    def call(*arguments):
        code = cli.main([str(a) for a in arguments])
        streams = capsys.readouterr()
        return code, streams.out, streams.err

    return call


@pytest.fixture
def data(tmp_path):
    file = tmp_path / "data.csv"
    file.write_text(DATA)
    return file


def schema(name):
    found = json.loads((resources.files("signlin_ros") / "schemas" / f"{name}.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(found)
    return found


def checked(name, text):
    """The one JSON object of an output, valid against its schema."""
    content = json.loads(text)
    jsonschema.validate(content, schema(name), cls=jsonschema.Draft202012Validator)
    return content


# -------------------------------------------------------------------- help


@pytest.mark.parametrize("verb", ["linearize", "simulate", "effects", "plants", "figures"])
def test_help_explains_and_gives_examples(run, verb):
    code, out, _ = run(verb, "--help")
    assert code == 0
    assert f"signlin {verb}" in out.split("Examples:")[1]
    assert "--json" in out


def test_help_lists_the_verbs_and_version_the_version(run):
    code, out, _ = run("--help")
    assert code == 0
    for verb in ("linearize", "simulate", "effects", "plants", "figures"):
        assert verb in out
    assert run("--version")[1].startswith("signlin")


def test_help_takes_less_than_half_a_second():
    """Of processor time, which does not depend on what else the machine does."""

    def spent():
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    best = 9.0
    for _ in range(3):
        start = spent()
        subprocess.run([sys.executable, "-m", "signlin_ros.cli", "--help"], check=True, capture_output=True)
        best = min(best, spent() - start)
    assert best < 0.5


# -------------------------------------------------------------------- linearize


def test_linearize_prints_one_json_object(run):
    code, out, err = run("linearize", "dc_motor", "--at", "current=0.4,speed=5", "--input", "voltage=2", "--json")
    assert (code, err) == (0, "")
    content = checked("linearize", out)
    want = linearize(Model.load("dc_motor"), [0.4, 5.0], [2.0])
    for name in ("A", "B", "c", "x", "u", "f"):
        np.testing.assert_array_equal(content[name], getattr(want, name))
    assert list(content) == [
        *("A", "B", "c", "x", "u", "f", "states", "inputs", "method", "sign_order", "sign_scale"),
        *("in_valid_range", "delay"),
    ]
    assert content["states"] == ["current", "speed"]
    assert content["inputs"] == ["voltage"]
    assert (content["method"], content["sign_order"], content["sign_scale"]) == ("termwise", 50, {"speed": 1.0})
    assert (content["in_valid_range"], content["delay"]) == (True, 0.0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("model", ["dc_motor", "bouc_wen", "mass_spring_damper", "force_element", "emps"])
def test_linearize_keeps_its_schema(run, model, method):
    code, out, _ = run("linearize", model, "--method", method, "--json")
    assert code == 0
    content = checked("linearize", out)
    assert content["method"] == method
    assert all(scale > 0 for scale in content["sign_scale"].values())


def test_linearize_as_text_names_rows_columns_and_units(run):
    code, out, err = run("linearize", "dc_motor", "--at", "speed=5")
    assert (code, err) == (0, "")
    for word in ("rad/s", "voltage", "termwise", "-293.846", "inside the valid range"):
        assert word in out


def test_linearize_takes_aliases_blanks_and_repeated_options(run):
    a = run("linearize", "dc_motor", "--at", "velocity = 5, current=1", "--json")[1]
    assert a == run("linearize", "dc_motor", "--at", "speed=5", "--at", "current=1", "--json")[1]
    assert run("linearize", "dc_motor", "--json")[1] == run("linearize", "dc_motor", "--at", "", "--json")[1]


def test_outside_the_valid_range_there_is_a_warning_beside_the_json(run):
    code, out, err = run("linearize", "dc_motor", "--at", "speed=20", "--json")
    assert code == 0
    assert checked("linearize", out)["in_valid_range"] is False
    assert "warning" in err
    assert "|speed| <= 16.67" in err


def test_a_position_with_weight_is_warned_of(run, tmp_path):
    model = Model.load("dc_motor").with_options(with_position=True)
    for weights, warned in (({}, True), ({"position": 0.0}, False)):
        model.with_options(state_weights=weights).save(tmp_path / "m.yaml")
        assert ("carries weight" in run("linearize", tmp_path / "m.yaml", "--method", "optimal")[2]) is warned
        assert "carries weight" not in run("linearize", tmp_path / "m.yaml", "--method", "termwise")[2]
    assert run("linearize", "bouc_wen")[2] == ""  # its spring says where 0 is


BAD = {
    "no model": (["linearize"], ["MODEL"]),
    "unknown model": (["linearize", "dc_moter"], ["dc_moter", "did you mean 'dc_motor'"]),
    "unknown verb": (["linearise", "dc_motor"], ["linearise"]),
    "unknown option": (["linearize", "dc_motor", "--att", "speed=1"], ["--att"]),
    "unknown method": (["linearize", "dc_motor", "--method", "best"], ["best", "termwise"]),
    "unknown state": (["linearize", "dc_motor", "--at", "sped=3"], ["--at", "'sped'", "did you mean 'speed'"]),
    "position of a motor": (["linearize", "dc_motor", "--at", "position=3"], ["with_position: true"]),
    "unknown input": (["linearize", "dc_motor", "--input", "volt=3"], ["--input", "'volt'", "voltage"]),
    "an input among the states": (["linearize", "dc_motor", "--at", "voltage=3"], ["no state", "use --input"]),
    "a name twice": (["linearize", "dc_motor", "--at", "speed=3,speed=4"], ["speed", "twice", "3", "4"]),
    "a name and its alias": (["linearize", "dc_motor", "--at", "speed=3,velocity=4"], ["speed", "twice", "velocity"]),
    "no number": (["linearize", "dc_motor", "--at", "speed=fast"], ["--at: speed", "'fast'", "a number"]),
    "no value": (["linearize", "dc_motor", "--at", "speed="], ["--at", "'speed='", "NAME=NUMBER"]),
    "no name": (["linearize", "dc_motor", "--at", "=3"], ["--at", "'=3'"]),
    "no equals sign": (["linearize", "dc_motor", "--at", "3"], ["--at", "'3'", "NAME=NUMBER"]),
    "NaN": (["linearize", "dc_motor", "--at", "speed=nan"], ["--at: speed", "'nan'", "finite"]),
    "infinite": (["linearize", "dc_motor", "--input", "voltage=inf"], ["--input: voltage", "finite"]),
    "too large": (["linearize", "dc_motor", "--at", "speed=1e999"], ["--at: speed", "'1e999'", "finite"]),
    "unknown effect": (["effects", "coulomb"], ["coulomb", "known"]),
    "unknown plant": (["plants", "dc_moter"], ["did you mean 'dc_motor'"]),
    "no data": (["simulate", "dc_motor"], ["DATA"]),
    "no output": (["simulate", "dc_motor", "{data}"], ["-o"]),
    "data not there": (["simulate", "dc_motor", "{data}x", "-o", "{out}"], ["data.csvx"]),
    "data is the output": (["simulate", "dc_motor", "{data}", "-o", "{data}"], ["-o", "would replace DATA"]),
    "a report over the data": (
        ["compare", "dc_motor", "{data}", "--report", "{data}"],
        ["--report", "'.csv'", ".html"],
    ),
    "a report of another kind": (["compare", "dc_motor", "{data}", "--report", "{out}.pdf"], ["'.pdf'", ".html"]),
    "a report in no folder": (
        ["compare", "dc_motor", "{data}", "--report", "{data}.no/r.html"],
        ["--report", "folder"],
    ),
    "data twice": (["compare", "dc_motor", "{data}", "{data}"], ["is the same record as DATA"]),
    "validation is the data": (
        ["diagnose", "dc_motor", "{data}", "--validation", "{data}"],
        ["--validation", "is the same record as DATA"],
    ),
    "output of another kind": (["simulate", "dc_motor", "{data}", "-o", "{out}.xls"], [".xls", ".csv"]),
    "unknown kind": (["simulate", "dc_motor", "{data}", "-o", "{out}", "--as", "real"], ["real", "exact"]),
    "rtol NaN": (["simulate", "dc_motor", "{data}", "-o", "{out}", "--rtol", "nan"], ["rtol", "nan"]),
    "rtol zero": (["simulate", "dc_motor", "{data}", "-o", "{out}", "--rtol", "0"], ["rtol"]),
    "signal without a column": (
        ["simulate", "dc_motor", "{data}", "-o", "{out}", "--signal", "voltage"],
        ["--signal", "NAME=COLUMN"],
    ),
    "signal of an unknown column": (
        ["simulate", "dc_motor", "{data}", "-o", "{out}", "--signal", "voltage=u"],
        ["'u'", "voltage"],
    ),
    "no such input in the data": (["simulate", "emps", "{data}", "-o", "{out}"], ["force", "--signal"]),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_exit_code_2_and_one_line(run, name, data, tmp_path):
    arguments, wanted = BAD[name]
    code, out, err = run(*(a.format(data=data, out=tmp_path / "out.csv") for a in arguments))
    assert (code, out) == (2, "")
    assert err.count("\n") == 1, err
    assert err.startswith("signlin: ")
    for word in wanted:
        assert word in err, err
    assert data.read_text() == DATA
    assert sorted(p.name for p in tmp_path.iterdir()) == ["data.csv"]


@pytest.mark.parametrize("verb", ["simulate", "compare", "add"])
@pytest.mark.parametrize("place", ["/proc", "/dev/full"])
def test_an_output_that_cannot_be_written_is_refused_before_any_work(run, data, monkeypatch, verb, place):
    def never(*_, **__):
        raise ZeroDivisionError("read")

    for reader in ("records.read_for_model", "follow.data.read_unmapped"):
        monkeypatch.setattr(f"signlin_ros.{reader}", never)
    option, suffix = {"simulate": ("-o", "csv"), "compare": ("--report", "html"), "add": ("-o", "yaml")}[verb]
    effect = ["coulomb_friction"] if verb == "add" else []
    code, out, err = run(verb, *effect, "dc_motor", data, option, f"{place}/new.{suffix}")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert f"{option} {place}/new.{suffix}" in err


def test_a_recording_is_the_same_by_its_folder_and_by_its_file(run, tmp_path):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "bag.mcap").write_text("a recording")
    for data, validation in (("bag", "bag/bag.mcap"), ("bag/bag.mcap", "bag"), ("bag/../bag", "bag")):
        code, _, err = run("diagnose", "dc_motor", tmp_path / data, "--validation", tmp_path / validation)
        assert (code, err.count("\n")) == (2, 1)
        assert f"--validation {tmp_path / validation}: is the same record as DATA" in err


@pytest.mark.slow
def test_a_report_says_the_command_that_leads_to_it(run, tmp_path):
    made = tmp_path / "made of it.csv"
    (tmp_path / "d.csv").write_text(DATA)
    assert run("simulate", "dc_motor", tmp_path / "d.csv", "-o", made)[0] == 0
    options = ("--horizon", "0.1", "--signal", "speed=speed")
    assert run("compare", "dc_motor", made, *options, "--report", tmp_path / "r.html")[0] == 0
    command = f"signlin compare dc_motor '{made}' {' '.join(options)}"
    assert command in html.unescape((tmp_path / "r.html").read_text())


def test_no_output_replaces_what_is_read(run, tmp_path, data):
    bag = tmp_path / "bag"
    bag.mkdir()
    (bag / "bag.mcap").write_text("a recording")
    (tmp_path / "link.html").symlink_to(data)
    Model.load("dc_motor").save(tmp_path / "model.csv")
    for arguments, name in (
        (["simulate", "dc_motor", bag, "-o", bag / "bag.mcap"], "DATA"),
        (["compare", "dc_motor", data, "--report", tmp_path / "link.html"], "DATA"),
        (["simulate", tmp_path / "model.csv", data, "-o", tmp_path / "model.csv"], "the model"),
    ):
        code, _, err = run(*arguments)
        assert (code, err.count("\n")) == (2, 1)
        assert f"would replace {name}" in err
    assert (bag / "bag.mcap").read_text() == "a recording"
    assert data.read_text() == DATA


def test_a_report_whose_pictures_have_no_place_is_refused(run, tmp_path, data):
    (tmp_path / "r_files").write_text("a file")
    code, _, err = run("compare", "dc_motor", data, "--report", tmp_path / "r.html")
    assert (code, err.count("\n")) == (2, 1)
    assert "r_files: this is a file" in err


def test_no_warning_of_a_library_stands_before_the_one_line(run, tmp_path):
    (tmp_path / "c.csv").write_text("t,voltage\n0,1\n1,1\n")
    code, out, err = run("diagnose", "dc_motor", tmp_path / "c.csv")
    assert (code, out) == (2, "")
    assert err == f"signlin: {tmp_path / 'c.csv'}: nothing to compare with: none of current, speed is measured\n"


def test_a_full_disk_is_no_fault_of_ours():
    command = f"{sys.executable} -m signlin_ros.cli effects --json > /dev/full"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (2, "signlin: writing the output: No space left on device\n")


def test_help_on_a_full_disk_is_no_fault_of_ours():
    command = f"{sys.executable} -m signlin_ros.cli simulate --help > /dev/full"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (2, "signlin: writing the output: No space left on device\n")


def refusing(number, *file):
    def broken(*_, **__):
        raise OSError(number, os.strerror(number), *file)

    return broken


def test_what_the_system_refuses_inside_a_command_is_a_fault_and_not_the_output(run, monkeypatch):
    monkeypatch.delenv("SIGNLIN_DEBUG", raising=False)
    for number in (errno.ENOMEM, errno.ENOSPC):
        monkeypatch.setattr(Model, "load", refusing(number))
        code, out, err = run("linearize", "dc_motor")
        assert (code, out, err.count("\n")) == (1, "", 1)
        assert "writing the output" not in err
        assert f"OSError: [Errno {int(number)}] {os.strerror(number)}; this is a fault" in err
    monkeypatch.setenv("SIGNLIN_DEBUG", "1")
    with pytest.raises(OSError, match="No space left"):
        run("linearize", "dc_motor")


def test_a_path_that_the_system_refuses_is_bad_input(run):
    code, out, err = run("linearize", "a" * 300)
    assert (code, out, err) == (2, "", f"signlin: {'a' * 300}: File name too long\n")


def test_a_disk_that_fills_up_under_a_model_file_is_no_fault_of_ours(run, data, tmp_path, monkeypatch):
    done = SimpleNamespace(yaml="")
    monkeypatch.setattr("signlin_ros.diagnosis.verbs.add", lambda *_, **__: done)
    monkeypatch.setattr("signlin_ros.diagnosis.load_records", lambda model, *_: (model, [()]))
    monkeypatch.setattr("signlin_ros.guard.check_records", lambda _, records, *__, **___: (records, []))
    monkeypatch.setattr("signlin_ros.diagnosis.proposal.printed", lambda result, *_: result)
    monkeypatch.setattr("signlin_ros.files.write_text", refusing(errno.ENOSPC))
    code, out, err = run("add", "coulomb_friction", "dc_motor", data, "-o", tmp_path / "new.yaml")
    assert (code, out) == (2, "")
    assert err == f"signlin: -o: cannot write {tmp_path / 'new.yaml'}: No space left on device\n"


def test_a_fault_of_ours_is_exit_code_1_without_a_traceback(run, monkeypatch):
    def broken(*_):
        raise ZeroDivisionError("inside")

    monkeypatch.setattr(signlin_ros.linearization, "Linearizer", broken)
    monkeypatch.delenv("SIGNLIN_DEBUG", raising=False)
    code, out, err = run("linearize", "dc_motor")
    assert (code, out) == (1, "")
    assert err.count("\n") == 1
    assert "ZeroDivisionError: inside" in err
    assert "report" in err
    monkeypatch.setenv("SIGNLIN_DEBUG", "1")
    with pytest.raises(ZeroDivisionError):
        run("linearize", "dc_motor")


def test_a_missing_extra_is_exit_code_2_with_the_install_command(run, monkeypatch):
    def broken(*_):
        raise MissingExtraError("drawing", "plot")

    monkeypatch.setattr(signlin_ros.linearization, "Linearizer", broken)
    code, _, err = run("linearize", "dc_motor")
    assert code == 2
    assert 'pip install "signlin_ros[plot]"' in err


def test_a_reader_that_stops_reading_is_no_fault():
    command = f"{sys.executable} -m signlin_ros.cli effects --json | head -c 100"
    done = subprocess.run(["bash", "-o", "pipefail", "-c", command], capture_output=True, text=True, check=False)
    assert done.stderr == ""


# -------------------------------------------------------------------- catalogue


def test_effects_as_json_and_text(run):
    code, out, err = run("effects", "--json")
    assert (code, err) == (0, "")
    content = checked("effects", out)["effects"]
    assert list(content) == list(EFFECTS)
    mu = content["coulomb_friction"]["parameters"]["mu"]
    assert mu["units"]["dc_motor"] == "N·m"
    assert mu["units"]["mass_spring_damper"] == "N"
    assert content["thermal_resistance"]["plants"] == ["dc_motor"]
    assert "force_element" not in content["load_dependent_friction"]["plants"]
    assert content["coulomb_friction"]["source"].startswith("Coulomb 1785")
    text = run("effects")[1]
    for entry in content.values():
        assert entry["name"] in text
        assert entry["equation"] in text


@pytest.mark.parametrize("name", EFFECTS)
def test_one_effect_in_full(run, name):
    content = checked("effects", run("effects", name, "--json")[1])["effects"]
    assert list(content) == [name]
    code, text, _ = run("effects", name)
    assert code == 0
    assert content[name]["equation"] in text
    for parameter, par in content[name]["parameters"].items():
        assert f"  {parameter} " in text
        assert par["doc"] in text
        assert set(par["units"]) == set(content[name]["plants"])


def test_an_effect_of_ones_own_is_shown_with_the_model_that_names_it(run, tmp_path):
    law = "class A(Effect):\n    name = equation = 'my_drag'\n    def force(self, m, x, p): return -x.velocity\n"
    (tmp_path / "a.py").write_text(f"from signlin_ros.effects import Effect\n{law}")
    Model.load("dc_motor").with_options(effect_files=[str(tmp_path / "a.py")]).save(tmp_path / "m.yaml")
    try:
        code, out, _ = run("effects", "my_drag", "--model", tmp_path / "m.yaml")
        assert (code, "law" in out) == (0, True)
    finally:
        EFFECTS.pop("my_drag", None)
    code, _, err = run("effects", "my_drag")
    assert (code, "my_drag" in err) == (2, True)


def test_plants_as_json_and_text(run):
    content = checked("plants", run("plants", "--json")[1])["plants"]
    assert list(content) == list(PLANTS)
    assert content["dc_motor"]["states"] == {"current": "A", "speed": "rad/s"}
    assert content["dc_motor"]["optional_inputs"] == {"load_torque": "N·m"}
    assert content["dc_motor"]["aliases"] == {"position": "position", "velocity": "speed", "effort": None}
    assert content["force_element"]["outputs"] == {"force": "N"}
    text = run("plants")[1]
    for entry in content.values():
        assert entry["equation"] in text


@pytest.mark.parametrize("name", PLANTS)
def test_one_plant_in_full(run, name):
    content = checked("plants", run("plants", name, "--json")[1])["plants"]
    code, text, _ = run("plants", name)
    assert code == 0
    for parameter in content[name]["parameters"]:
        assert f"  {parameter} " in text


# -------------------------------------------------------------------- figures


def test_figures_keep_their_schema_and_are_refused_where_they_cannot_be_written(run, tmp_path, monkeypatch):
    def drawn(folder):
        return {"files": [str(folder / name) for name in ("beyond_sign.png", "figure_1.png", "figure_4.json")]}

    monkeypatch.setattr(signlin_ros.figures, "make_figures", drawn)
    content = checked("figures", run("figures", "-o", tmp_path / "new", "--json")[1])
    assert content["files"] == drawn(tmp_path / "new")["files"]
    code, out, err = run("figures", "-o", "/proc")
    assert (code, out) == (2, "")
    assert err == "signlin: -o: /proc: cannot be written: No such file or directory\n"


def test_numbers_of_a_figure_that_cannot_be_written_are_no_fault_of_ours(tmp_path):
    with pytest.raises(InputError, match=r"cannot write .*figure_4\.json: No such file or directory"):
        signlin_ros.figures._written(tmp_path / "gone" / "figure_4.json", {})


def test_every_verb_with_json_has_a_schema():
    verbs = {name for name, command in cli.signlin.commands.items() if "as_json" in {p.name for p in command.params}}
    for verb in verbs - {"add", "refine"}:  # as diagnose
        schema(verb)


# -------------------------------------------------------------------- simulate


def read(file):
    table = np.genfromtxt(file, delimiter=",", names=True, deletechars="")
    return {name: table[name] for name in table.dtype.names}


@pytest.mark.parametrize("kind", cli.KINDS)
def test_simulate_writes_time_inputs_states_and_outputs_once(run, data, tmp_path, kind):
    code, out, err = run("simulate", "dc_motor", data, "-o", tmp_path / "o.csv", "--as", kind, "--json")
    assert (code, err) == (0, "")
    content = checked("simulate", out)
    found = read(tmp_path / "o.csv")
    assert list(found) == ["t", "voltage", "current", "speed"]
    np.testing.assert_array_equal(found["t"], read(data)["t"])
    np.testing.assert_array_equal(found["voltage"], read(data)["voltage"])
    assert found["speed"][0] == 0.0
    assert found["speed"].max() > 3.0
    assert content["as"] == kind
    assert content["samples"] == 101
    assert content["final_state"] == {"current": found["current"][-1], "speed": found["speed"][-1]}
    assert content["initial_state_from"] == "model"


def test_simulate_starts_from_the_first_row_where_it_holds_every_state(run, tmp_path):
    rows = [(k / 100, 0.0, 0.3, 7.0) for k in range(11)]
    for columns, start, where in (("t,voltage,current,speed", 7.0, "data"), ("t,voltage,current", 2.0, "model")):
        lines = [",".join(map(str, row[: columns.count(",") + 1])) for row in rows]
        (tmp_path / "d.csv").write_text("\n".join([columns, *lines]) + "\n")
        Model.load("dc_motor").with_options(initial_state={"speed": 2.0}).save(tmp_path / "m.yaml")
        arguments = ["simulate", tmp_path / "m.yaml", tmp_path / "d.csv", "-o", tmp_path / "o.csv", "--json"]
        content = checked("simulate", run(*arguments)[1])
        assert content["initial_state"]["speed"] == start == read(tmp_path / "o.csv")["speed"][0]
        assert content["initial_state_from"] == where


def test_simulate_maps_signals_and_says_what_it_did(run, tmp_path):
    (tmp_path / "d.csv").write_text(DATA.replace("voltage", "u_cmd [V]"))
    out = tmp_path / "o.csv"
    code, text, _ = run("simulate", "dc_motor", tmp_path / "d.csv", "-o", out, "--signal", "voltage=u_cmd")
    assert code == 0
    for word in ("o.csv", "101 samples", "initial_state", "rad/s"):
        assert word in text
    assert read(out)["voltage"].max() == 2.0


def test_a_force_elements_file_holds_its_output(run, tmp_path):
    (tmp_path / "d.csv").write_text(DATA.replace("voltage", "velocity"))
    assert run("simulate", "force_element", tmp_path / "d.csv", "-o", tmp_path / "o.csv")[0] == 0
    assert list(read(tmp_path / "o.csv")) == ["t", "velocity", "displacement", "force"]


@pytest.mark.parametrize("name", ["o.foo", "o", "nowhere/o.csv", "folder.csv"])
def test_a_bad_output_is_refused_before_anything_is_simulated(run, data, tmp_path, monkeypatch, name):
    def never(*_, **__):
        raise ZeroDivisionError("simulated")

    (tmp_path / "folder.csv").mkdir()
    monkeypatch.setattr(signlin_ros.simulation, "simulate", never)
    code, out, err = run("simulate", "dc_motor", data, "-o", tmp_path / name)
    assert (code, out) == (2, "")
    assert name.split("/")[0] in err
    assert "Zero" in run("simulate", "dc_motor", data, "-o", tmp_path / "o.csv")[2]


def test_simulate_starts_from_the_true_state_behind_what_was_measured(run, tmp_path):
    (tmp_path / "d.csv").write_text("t,voltage,current,speed\n0,0,0.8,5.5\n0.01,0,0.7,5.4\n")
    model = Model.load("dc_motor").with_effect("sensor_offset", speed=0.5).with_effect("sensor_gain", current=2.0)
    model.save(tmp_path / "m.yaml")
    out = run("simulate", tmp_path / "m.yaml", tmp_path / "d.csv", "-o", tmp_path / "o.csv", "--json")[1]
    assert checked("simulate", out)["initial_state"] == {"current": 0.4, "speed": 5.0}
    assert read(tmp_path / "o.csv")["speed"][0] == 5.0


def test_a_run_that_diverges_says_when_and_leaves_no_file(run, tmp_path):
    rows = "".join(f"{k / 20},{30.0 * np.sin(3 * k / 20)}\n" for k in range(2000))
    (tmp_path / "d.csv").write_text("t,force\n" + rows)
    model = Model.load("bouc_wen").with_parameters(gamma=-30.0, n=3.0)
    model.save(tmp_path / "m.yaml")
    code, out, err = run("simulate", tmp_path / "m.yaml", tmp_path / "d.csv", "-o", tmp_path / "o.csv")
    assert (code, out) == (2, "")
    assert "t = " in err
    assert not (tmp_path / "o.csv").exists()


def test_what_a_node_waits_for_is_its_model_alone(monkeypatch):
    """A node has a better model compiled while it runs: a diagnosis is compiled by `signlin warm` without a model."""
    from signlin_ros.cli import warming

    asked: list[str] = []
    monkeypatch.setattr(warming, "warm_up", lambda: asked.append("diagnosis") or 0.0)
    monkeypatch.setattr("signlin_ros.warming.warm_up", lambda model: asked.append(model.plant.name) or 0.0)
    assert cli.main(["warm", "config/dc_motor.yaml"]) == 0
    assert asked == ["dc_motor"]
    assert cli.main(["warm"]) == 0
    assert asked[-1] == "diagnosis"
