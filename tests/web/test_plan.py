"""What to record next: form and plan below a diagnosis, its files, the record after it; nothing foreign runs."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from signlin_ros.errors import InputError, ModelError
from signlin_ros.model import Model
from signlin_ros.simulation import simulate
from signlin_ros.workbench import commands, planning, plans, questions
from signlin_ros.workbench.calls import WORKER_CALLS
from signlin_ros.workbench.project import Project, fresh, plan_of, safe_name
from signlin_ros.workbench.session import Session
from signlin_ros.workbench.uploaded import CodeError
from signlin_ros.workbench.wording import on_page

if TYPE_CHECKING:
    from conftest import Client, Page, Server

DT = 0.005
T = DT * np.arange(1000)
EVIL = """from pathlib import Path
Path({place!r}).touch()
from signlin_ros.effects import Effect
class Mine(Effect):
    name = "mine_of_the_plan"
    equation = "F = 0"
    def force(self, m, x, p):
        return 0.0 * x.velocity
"""


def given() -> Model:
    model = Model.load("dc_motor").without_effect("coulomb_friction").with_parameters({"B": 2e-4})
    return model.with_options(tolerance=0.05)


def recorded(file: Path, t: Any, u: Any, seed: int, skip: int = 0) -> Path:
    """Record a motor that has dry friction."""
    found, g = simulate(given().with_effect("coulomb_friction", mu=0.03), t, u[:, None]), np.random.default_rng(seed)
    channels = (("current", 0.05), ("speed", 0.4))
    noisy = (found[c][skip:] + sd * g.standard_normal(t.size - skip) for c, sd in channels)
    table = np.column_stack([t[skip:] - t[skip], u[skip:], *noisy])
    np.savetxt(file, table, delimiter=",", header="t,voltage,current,speed", comments="", fmt="%.7g")
    return file


@pytest.fixture(scope="session")
def one_way(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A motor that turned one way: dry friction is a load there."""
    folder = tmp_path_factory.mktemp("one_way")
    given().save(folder / "model.yaml")
    u = (3.5 + np.sin(2 * np.pi * 1.3 * T) + 0.5 * np.sin(2 * np.pi * 3.1 * T)) * np.clip(T / 0.2, 0, 1)
    recorded(folder / "first.csv", T, u, 1, skip=60)
    return folder


def rival(effect: str, **values: float) -> dict[str, Any]:
    """Return a rival as the JSON of a diagnosis has it."""
    model, name = given().with_effect(effect, **values), f"{effect}.{next(iter(values))}"
    return {"effects": [effect], "model": model.to_yaml(), "parameters": [name], "covariance": [[1e-6]]}


def tie() -> dict[str, Any]:
    """Return what a diagnosis that ends in a tie tells, as far as a plan needs it."""
    rivals = [rival("coulomb_friction", mu=0.03), rival("constant_load", F0=-0.03)]
    content = {"verdict": "missing", "ranking": [], "ladder": [{"effects": ["coulomb_friction"]}], "rivals": rivals}
    return {**content, "given_model": given().to_yaml()}


def asked(folder: Path, **more: Any) -> dict[str, Any]:
    files = {"model": str(folder / "model.yaml"), "data": [str(folder / "first.csv")], "validation": []}
    form = {"limits": {"voltage": 6.0}, "between": [], "duration": None, "dt": None, "spare": 0.2}
    return {**files, **form, "diagnosis": tie(), **more}


# -------------------------------------------------------------------- a plan by the worker


@pytest.mark.slow
def test_a_tie_is_planned_for_with_progress_curves_and_files(one_way: Path, tmp_path: Path) -> None:
    told: list[dict[str, Any]] = []
    between = ["coulomb_friction", "constant_load"]
    store = str(tmp_path / "plan.npz")
    found = WORKER_CALLS["experiment"](asked(one_way, between=between, store=store), told.append)
    json.dumps(found, allow_nan=False)
    assert found["json"]["verdict"] == "enough"
    assert found["csv"].startswith("t,voltage\n")
    assert [p["rivals"] for p in found["previews"]] == [
        list(reversed(p["rivals"])) for p in reversed(found["previews"])
    ]
    shares = [one["share"] for one in told]
    assert len({one["what"] for one in told}) > 3
    assert all(0.0 <= share <= 1.0 for share in shares)
    shown = {"store": store, "input": "voltage", "unit": "V", "channels": found["previews"][0]["channels"], "way": 0}
    plots = WORKER_CALLS["plan_curves"](shown, told.append)["plots"]
    assert [p["name"] for p in plots] == ["voltage", "current", "speed", "distance"]
    assert set(plots[1]["curves"]) == {"low", "high", "true", "other"}
    file = tmp_path / "next.rivals.json"
    file.write_text(found["rivals"])
    assert {one.effects[0] for one in planning.rivals_of(str(file), tmp_path)} == set(between)


@pytest.mark.parametrize(
    ("more", "told"),
    [({"limits": {"volt": 1.0}}, "unknown name 'volt'"), ({"between": ["nothing", "nonsense"]}, "unknown effect")],
)
def test_what_cannot_be_planned_is_refused_in_a_line(one_way: Path, more: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told) as refused:
        WORKER_CALLS["experiment"](asked(one_way, store="none", **more), print)
    assert "--" not in on_page(str(refused.value)).split(";")[0]


def test_limits_are_what_the_records_visited(one_way: Path) -> None:
    from signlin_ros.diagnosis import load_records

    found = {one["name"]: one for one in planning.asked_limits(*load_records(given(), [str(one_way / "first.csv")]))}
    assert found["voltage"]["value"] == pytest.approx(5.0, abs=0.1)
    assert 20.0 < found["speed"]["value"] < 200.0
    assert found["position"]["value"] is None
    assert (found["slew"]["unit"], found["slew"]["value"]) == ("V/s", None)
    assert planning.asked_limits(Model.load("force_element"), []) == []


# -------------------------------------------------------------------- nothing foreign runs


def foreign(folder: Path) -> tuple[str, Path]:
    """Return the model of a rival that names code, and what that code would make."""
    hacked = folder / "hacked"
    (folder / "evil.py").write_text(EVIL.format(place=str(hacked)))
    return given().to_yaml() + f"    effect_files: [{folder / 'evil.py'}]\n", hacked


def rivals_file(folder: Path, text: str, name: str = "next_1.rivals.json") -> Path:
    (folder / name).write_text(json.dumps({"rivals": [{"effects": [], "starts": [text], "of_interest": {}}]}))
    return folder / name


@pytest.mark.parametrize("where", ["rival", "given", "file", "old file"])
def test_a_foreign_diagnosis_or_file_of_rivals_runs_no_code(one_way: Path, tmp_path: Path, where: str) -> None:
    text, hacked = foreign(tmp_path)
    args = {**asked(one_way, store="none"), "key": "foreign"}
    verb = "experiment" if where in ("rival", "given") else "diagnose"
    if where == "rival":
        args["diagnosis"]["rivals"][1]["model"] = text
    elif where == "given":
        args["diagnosis"]["given_model"] = text
    elif where == "file":
        args["rivals"] = str(rivals_file(tmp_path, text))
    else:
        args["rivals"] = str(tmp_path / "next_1.rivals.json")
        Path(args["rivals"]).write_text(json.dumps({"rivals": [{"effects": [], "model": text}]}))
    with pytest.raises(CodeError) as refused:
        WORKER_CALLS[verb](args, lambda _: None)
    assert [Path(one["file"]).name for one in refused.value.files] == ["evil.py"]
    assert not hacked.exists()


def test_a_folder_of_somebody_else_with_a_plan_runs_no_code(client: Client, one_way: Path, tmp_path: Path) -> None:
    text, hacked = foreign(tmp_path)
    store, name = client.server.folder / ".signlin", "bbbbbbbbbbbb"
    (store / name / "results").mkdir(parents=True)
    for file in ("model.yaml", "first.csv"):
        (store / name / file).write_bytes((one_way / file).read_bytes())
    rivals_file(store / name, text)
    plan = {"asked": None, "model": "model.yaml", "records": [], "names": ["mine"], "files": {}}
    plan["files"] = {"rivals": "next_1.rivals.json"}
    records = [{"file": "first.csv", "role": "estimation"}]
    choices = {"model": "model.yaml", "records": records, "cures": [], "path": [], "planned": plan}
    state = {"version": 1, "created": 0.0, "choices": choices, "past": [], "future": [], "count": 0}
    (store / name / "state.json").write_text(json.dumps(state))
    client.act(name, "check")
    said = next(b for b in client.settled(name)["stages"] if b["id"] == "diagnose")
    assert said["sentence"].startswith("Which rival of the plan is it?")
    assert client.act(name, "diagnose")[0] == 200
    shown = client.settled(name)
    assert [Path(one["file"]).name for one in shown["code"]] == ["evil.py"]
    assert "names code of its own" in next(b for b in shown["stages"] if b["id"] == "diagnose")["error"]["what"]
    assert not hacked.exists()


def test_a_dropped_file_of_rivals_may_name_no_code_at_all(client: Client, tmp_path: Path) -> None:
    text, hacked = foreign(tmp_path)
    project = client.project()
    body = rivals_file(tmp_path, text).read_bytes()
    name = json.loads(client.put(project, "theirs.rivals.json", body)[1])["file"]
    assert name == "theirs.rivals.json"
    client.act(project, "take", files=[name])
    state = client.settled(project)
    assert "code is not taken from the browser" in state["stages"][0]["error"]["what"]
    assert state["code"] == []
    assert not hacked.exists()


@pytest.mark.parametrize(
    "text",
    ["[1, 2", "[]", '{"rivals": 3}', '{"rivals": []}', '{"rivals": [{"effects": []}]}', "[" * 100_000],
    ids=["open", "list", "number", "none", "no effects", "deep"],
)
def test_what_is_no_file_of_rivals_is_refused_in_a_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "x.rivals.json").write_text(text)
    with pytest.raises(InputError) as refused:
        planning.rivals_of(str(tmp_path / "x.rivals.json"), tmp_path)
    assert len(str(refused.value)) < 300


def test_a_bomb_in_a_rival_is_refused(tmp_path: Path) -> None:
    bomb = "a: &a [x, x]\n" + "".join(f"{k}: &{k} [*{p}, *{p}]\n" for p, k in zip("abcdefgh", "bcdefghi", strict=True))
    with pytest.raises(ModelError, match="anchors"):
        planning.rivals_of(str(rivals_file(tmp_path, bomb)), tmp_path)


# -------------------------------------------------------------------- what the page asks, and says


def session(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Session:
    """Return a project with a model and a record that were read, as far as a plan asks."""
    monkeypatch.chdir(folder)
    made = Project.create(folder / ".signlin")
    (made.folder / "first.csv").write_text("t,voltage\n")
    made.amend(model="model.yaml", records=[{"file": "first.csv", "role": "estimation"}])
    return Session(made)


@pytest.mark.parametrize(
    ("form", "told"),
    [
        ({"limits": {"voltage": "-3"}}, "voltage: found '-3'; allowed: a number above 0"),
        ({"limits": {"slew": "fast"}}, "slew: found 'fast'"),
        ({"duration": "0"}, "duration: found '0'"),
        ({"spare": "100"}, "allowed: 0 to below 100 %"),
        ({"between": ["coulomb_friction", ""]}, "choose two rivals"),
        ({"between": ["coulomb_friction", "coulomb_friction"]}, "choose two rivals"),
    ],
)
def test_what_was_written_wrongly_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: dict[str, Any], told: str
) -> None:
    s = session(tmp_path, monkeypatch)
    with pytest.raises(InputError, match=told):
        plans.asked(s, form)


def test_numbers_with_a_comma_and_empty_fields_are_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    form = {"limits": {"voltage": "6,5", "slew": ""}, "duration": " ", "dt": "0,002", "spare": "0"}
    found = plans.asked(session(tmp_path, monkeypatch), form)
    assert found["limits"] == {"voltage": 6.5}
    assert (found["duration"], found["dt"], found["spare"]) == (None, 0.002, 0.0)
    line = plans.command({**found, "output": "next.csv"}, "diagnosis.json")
    assert line == "signlin experiment diagnosis.json --limit voltage=6.5 --dt 0.002 --spare 0 -o next.csv"


def test_records_after_a_plan_are_judged_by_its_rivals_and_one_is_kept_from_the_fit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    s = session(tmp_path, monkeypatch)
    own = {"files": {"rivals": "next_1.rivals.json"}, "names": ["one", "other"], "records": ["first.csv"]}
    s.project.amend(planned={"asked": None, "model": "model.yaml", **own})
    assert plans.judges(s) is None
    assert "rivals" not in questions.question(s, "diagnose")
    records = [*s.project.choices["records"], *({"file": f"{n}.csv", "role": "estimation"} for n in ("run", "again"))]
    plans.one_to_judge(s.project.choices, records)
    assert [r["role"] for r in records] == ["estimation", "estimation", "validation"]
    s.project.amend(records=records)
    judged = plans.judges(s)
    assert judged == {"records": ["run.csv", "again.csv"], "rivals": ["one", "other"], "twice": True}
    step = {"verb": "diagnose", **questions.question(s, "diagnose")}
    assert commands.command(step).endswith(f"--rivals {s.project.place('next_1.rivals.json')}")
    assert "rivals" not in questions.question(s, "compare")
    s.project.amend(model="model_2.yaml")  # its rivals are others
    assert plans.judges(s) is None
    assert "rivals" not in questions.question(s, "diagnose")


@pytest.mark.parametrize(
    "planned",
    [
        "nonsense",
        {"files": {"rivals": "../../model.yaml"}, "asked": None, "model": "m", "names": [], "records": []},
        {"files": {"csv": "next_1.csv"}, "asked": None, "model": "m", "names": [], "records": []},
        {"files": {"rivals": "r"}, "asked": 3, "model": "m", "names": [], "records": []},
        {"files": {"rivals": "r"}, "asked": None, "model": "m", "names": [1], "records": 5},
    ],
)
def test_a_plan_of_somebody_else_that_is_none_is_not_there(planned: Any) -> None:
    choices = {"planned": planned, "records": [{"file": "a.csv"}]}
    assert plan_of(choices) is None
    assert fresh(choices) == []


def test_the_script_plans_from_the_diagnosis_before_it(tmp_path: Path) -> None:
    base = {"model": "m.yaml", "data": ["a.csv"], "validation": [], "signals": {}}
    form = {"limits": {"voltage": 6.0}, "between": ["a", "b"], "duration": None, "dt": None, "spare": 0.2}
    steps = [{"verb": "diagnose", **base}, {"verb": "experiment", **base, **form, "output": "p/next_1.csv"}]
    last = commands.script(tmp_path, "replay", steps, {}).splitlines()[-1]
    told = "signlin experiment replay/1_diagnose.json --limit voltage=6 --between a,b --spare 0.2 -o replay/next_1.csv"
    assert last == f"{told} --json > replay/2_experiment.json"


def test_names_of_rivals_files_are_safe() -> None:
    assert safe_name("../../x/.next.rivals.json") == "next.rivals.json"
    with pytest.raises(InputError):
        safe_name("state.json")


# -------------------------------------------------------------------- in a browser


def tied(folder: Path, project: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Store a diagnosis of a project of a server in ``folder``, one that ends in a tie."""
    monkeypatch.chdir(folder)
    s = Session(Project(folder / ".signlin", project))
    known = (("voltage", "V", 5.0), ("speed", "rad/s", 46.0))
    limits = [{"name": name, "doc": "", "unit": unit, "value": value} for name, unit, value in known]
    kept = {"json": {**tie(), "sentence": "A tie.", "notes": []}, "values": {}, "evidence": {}, "unseen": {}}
    s.project.keep(s.project.key("diagnose", questions.question(s, "diagnose")), {**kept, "limits": limits})


def planned_by_clicks(page: Page) -> str:
    """Write limits, choose two rivals, plan; return what the plan says."""
    from selenium.webdriver import Keys
    from selenium.webdriver.support.ui import Select

    page.wait(lambda: page.driver.find_elements("id", "do-plan"), "the form")
    for name, value in (("voltage", "6"), ("speed", "60")):
        page.type(f"limit-{name}", Keys.CONTROL, "a", Keys.NULL, value)
    for k, name in enumerate(("coulomb_friction", "constant_load")):
        Select(page.driver.find_element("id", f"between-{k}")).select_by_value(name)
    page.picture("plan_1_form", "plan")
    page.press("do-plan")
    page.done("diagnose")
    page.wait(lambda: page.driver.find_elements("css selector", "#plots-plan canvas"), "the command over time")
    page.still()
    page.picture("plan_2_planned", "planned")
    return str(page.driver.find_element("id", "plan-says").text)


def recorded_twice(page: Page, folder: Path, out: Path) -> None:
    """Run the planned command on the machine twice, and drop the records."""
    t, u = np.loadtxt(folder / "next_1.csv", delimiter=",", skiprows=1).T
    with page.settling():
        page.drop(*(recorded(out / f"{name}.csv", t, u, seed) for name, seed in (("run", 2), ("again", 3))))


@pytest.mark.slow
def test_a_stored_tie_is_planned_for_and_what_is_dropped_after_it_is_judged_by_its_rivals(
    server: Callable[..., Server],
    browser: Callable[..., Page],
    one_way: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    started, page = server(str(one_way / "model.yaml"), str(one_way / "first.csv")), browser(1280, 900)
    page.open(started.address)
    page.done("check")
    (project,) = (started.folder / ".signlin").iterdir()
    tied(started.folder, project.name, monkeypatch)
    page.driver.refresh()
    page.wait(lambda: page.driver.find_elements("id", "plan"), "the stored diagnosis")
    says = planned_by_clicks(page)
    assert "would tell Coulomb friction from constant load" in says
    recorded_twice(page, project, tmp_path)
    told = page.says("diagnose")
    assert told.startswith("Which rival of the plan is it? Coulomb friction and constant load are fitted to run.csv")
    assert "--rivals" in page.stage("diagnose").find_element("css selector", ".command").text
    with page.settling():
        page.click("undo")
    page.wait(lambda: page.driver.find_elements("id", "planned"), "the plan to be there again")
    assert [m for m in page.driver.get_log("browser") if m["level"] == "SEVERE"] == []


@pytest.mark.long
def test_a_tie_to_the_next_record_and_its_verdict_by_clicks(
    server: Callable[..., Server], browser: Callable[..., Page], one_way: Path, tmp_path: Path
) -> None:
    started, page = server(str(one_way / "model.yaml"), str(one_way / "first.csv")), browser(1280, 900)
    page.open(started.address)
    page.done("check")
    page.click("do-diagnose")
    page.done("diagnose")
    assert "would tell" in planned_by_clicks(page)
    (project,) = (started.folder / ".signlin").iterdir()
    recorded_twice(page, project, tmp_path)
    page.click("do-diagnose")
    page.done("diagnose")
    assert "lacks Coulomb friction" in page.says("diagnose")
    page.picture("plan_3_judged", "stage-diagnose")


@pytest.mark.slow
def test_a_plan_is_refused_or_cancelled_and_nothing_is_changed(
    client: Client, one_way: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stored diagnosis of a tie is planned for by the server; the plan is stopped on its way."""
    project = client.project()
    bodies = {name: (one_way / name).read_bytes() for name in ("model.yaml", "first.csv")}
    names = [json.loads(client.put(project, name, body)[1])["file"] for name, body in bodies.items()]
    client.act(project, "take", files=names)
    client.settled(project)
    folder = client.server.folder / ".signlin" / project
    tied(client.server.folder, project, monkeypatch)
    block = next(b for b in client.state(project)["stages"] if b["id"] == "diagnose")
    assert block["form"]["rivals"] == ["coulomb_friction", "constant_load"]
    assert client.act(project, "plan", limits={"voltage": "none"})[0] == 400
    client.act(project, "plan", between=["nothing", "nonsense"])
    block = next(b for b in client.settled(project)["stages"] if b["id"] == "diagnose")
    assert block["error"]["what"].startswith("unknown effect 'nonsense'")
    assert block["error"]["do"] == "Allow more, keep less margin, or choose two rivals."
    assert block["done"]  # the diagnosis is still there
    assert client.act(project, "plan", limits={"voltage": "6"}, between=["coulomb_friction", "constant_load"])[0] == 200
    while not str((client.state(project)["busy"] or {"what": ""})["what"]).startswith("planning: "):
        assert client.state(project)["busy"], "it went by unseen"
    client.act(project, "cancel")
    state = client.settled(project)
    block = next(b for b in state["stages"] if b["id"] == "diagnose")
    assert block["error"]["what"] == "Cancelled."
    assert block["plan"] is None
    assert not list(folder.glob("next_*"))
