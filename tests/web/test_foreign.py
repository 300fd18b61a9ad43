"""A folder from somebody else, bad luck, two at once: nothing runs unasked, is overwritten, or is lost."""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import signal
import subprocess
import sys
import threading
import zipfile
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from signlin_ros.workbench import trust

if TYPE_CHECKING:
    from conftest import Client, Server

CSV = b"t,voltage,current,speed\n" + b"".join(b"%g,1,0.5,%g\n" % (0.01 * k, 0.1 * k) for k in range(100))
MODEL = "/**:\n  ros__parameters:\n    plant: dc_motor\n    parameters: {R_a: 1, L_a: 0, K_t: 1, K_m: 1, B: 0, J: 1}\n"
EVIL = """from pathlib import Path
Path("hacked").touch()
from signlin_ros.effects import Effect
from signlin_ros.par import Par
class Mine(Effect):
    name = "mine"
    equation = "F = -a v"
    a = Par("F·s/Q", nominal=0.1, low=0.0, high=1.0, doc="damping")
    def force(self, m, x, p):
        return -p.a * x.velocity
"""


@pytest.fixture(autouse=True)
def _state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was agreed to on this machine is not that of the tests."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def foreign(folder: Path, model: str) -> str:
    """Make a project as somebody else might have sent it."""
    project = folder / ".signlin" / "aaaaaaaaaaaa"
    (project / "results").mkdir(parents=True)
    (project / "run.csv").write_bytes(CSV)
    (project / "evil.py").write_text(EVIL)
    (project / "model.yaml").write_text(f"{MODEL}    effect_files: [evil.py]\n")
    choices = {"model": model, "records": [{"file": "run.csv", "role": "estimation"}], "cures": [], "path": []}
    state = {"version": 1, "created": 0.0, "choices": choices, "past": [], "future": [], "count": 0}
    (project / "state.json").write_text(json.dumps(state))
    return project.name


def opened(given: Server, project: str) -> tuple[Client, Any]:
    """Open a project as a page does: somebody listens."""
    client = given.client()
    threading.Thread(target=_listen, args=(client, project), daemon=True).start()
    state = client.state(project)
    while not (state["busy"] or state["code"] or state["records"][0]["found"]):
        state = client.state(project)
    return client, client.settled(project)


def _listen(client: Client, project: str) -> None:
    with closing(http.client.HTTPConnection(client.host, client.port, timeout=300)) as connection:
        connection.request("GET", f"/p/{project}/events")
        with contextlib.suppress(OSError, http.client.HTTPException):
            connection.getresponse().read()


@pytest.mark.parametrize("where", ["model.yaml", "absolute", "outside"])
def test_code_of_a_project_runs_only_after_it_was_shown_and_agreed_to(
    server: Callable[..., Server], tmp_path: Path, where: str
) -> None:
    name = {"absolute": str(tmp_path / ".signlin" / "aaaaaaaaaaaa" / "model.yaml"), "outside": "../../mine.yaml"}
    project = foreign(tmp_path, name.get(where, where))
    (tmp_path / "mine.yaml").write_text(f"{MODEL}    effect_files: [.signlin/aaaaaaaaaaaa/evil.py]\n")
    given = server()
    client, state = opened(given, project)
    assert [Path(one["file"]).name for one in state["code"]] == ["evil.py"]
    assert state["code"][0]["text"] == EVIL
    assert "names code of its own, evil.py" in state["stages"][0]["error"]["what"]
    for what, args in (("tune", {"values": {}}), ("compare", {}), ("record", {})):
        client.ask("POST", f"/p/{project}/show/{what}", json.dumps(args).encode(), {"x-signlin": "1"})
    for act in ("compare", "diagnose", "check", "export"):
        client.act(project, act)
        client.settled(project)
    assert not list(tmp_path.rglob("hacked"))
    assert client.act(project, "trust", digests=["0" * 64])[0] == 404
    client.act(project, "check")
    digest = client.settled(project)["code"][0]["digest"]
    assert client.act(project, "trust", digests=[digest])[0] == 200
    state = client.settled(project)
    assert state["code"] == []
    assert (tmp_path / "hacked").exists()
    assert state["model"]["plant"] == "dc_motor"


def test_no_verb_of_the_worker_runs_code_that_was_not_agreed_to(tmp_path: Path) -> None:
    from signlin_ros.workbench.calls import WORKER_CALLS
    from signlin_ros.workbench.uploaded import CodeError

    (tmp_path / "evil.py").write_text(f"open({str(tmp_path / 'hacked')!r}, 'w')\n{EVIL}")
    model = tmp_path / "model.yaml"
    model.write_text(f"{MODEL}    effect_files: [evil.py]\n")
    (tmp_path / "run.csv").write_bytes(CSV)
    run = str(tmp_path / "run.csv")
    args = {"model": str(model), "data": [run], "validation": [], "files": [run], "file": run, "signals": {}}
    args |= {"values": {}, "output": str(tmp_path / "out.yaml"), "effect": "mine", "report": str(tmp_path / "r.html")}
    others = {
        "ready",
        "reader",
        "models",
        "columns",
        "record_curves",
        "compare_curves",
        "compare_xy",
        "sample",
        "search",
        "written",
        "plan_curves",
        "rivals",
    }
    for name in sorted(WORKER_CALLS.keys() - others):
        with pytest.raises(CodeError):
            WORKER_CALLS[name](args, lambda _: None)
    assert not (tmp_path / "hacked").exists()


def test_bytecode_beside_a_file_that_was_agreed_to_does_not_run(tmp_path: Path) -> None:
    import py_compile

    from signlin_ros.workbench.uploaded import opened as model_of

    file, model = tmp_path / "mine.py", tmp_path / "model.yaml"
    file.write_text(f"open({str(tmp_path / 'hacked')!r}, 'w')\n{EVIL}")
    py_compile.compile(str(file), invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH)
    file.write_text(EVIL.replace('Path("hacked").touch()', "").replace('"mine"', '"mine_too"'))
    model.write_text(f"{MODEL}    effect_files: [mine.py]\n")
    trust.agree([trust.digest(file.read_bytes())])
    model_of(str(model))
    assert not (tmp_path / "hacked").exists()


def test_a_file_in_the_folder_is_not_taken_for_a_shipped_model_unasked(tmp_path: Path) -> None:
    from signlin_ros.workbench.uploaded import CodeError
    from signlin_ros.workbench.uploaded import opened as model_of

    (tmp_path / "evil.py").write_text(EVIL)
    (tmp_path / "dc_motor").write_text(f"{MODEL}    effect_files: [evil.py]\n")
    before = Path.cwd()
    os.chdir(tmp_path)
    try:
        with pytest.raises(CodeError):
            model_of("dc_motor")
    finally:
        os.chdir(before)
    assert not list(tmp_path.rglob("hacked"))


@pytest.mark.parametrize("link", ["results", "export", "model_1.yaml", ".run.csv.part", "export/model.yaml"])
def test_a_link_in_a_project_is_not_written_through(server: Callable[..., Server], tmp_path: Path, link: str) -> None:
    project = foreign(tmp_path, "dc_motor")
    folder, outside = tmp_path / ".signlin" / project, tmp_path / "outside"
    outside.write_text("mine")
    if link == "results":
        (folder / link).rmdir()
    if "/" in link:
        (folder / "export").mkdir()
    (folder / link).symlink_to(outside)
    client = server().client()
    assert client.put(project, "run.csv", CSV)[0] != 200
    assert "symbolic link" in client.ask("GET", f"/p/{project}/state")[1]
    assert outside.read_text() == "mine"


def test_a_link_that_comes_later_is_not_written_through(client: Client) -> None:
    project = client.project()
    folder = client.server.folder / ".signlin" / project
    outside = client.server.folder / "outside"
    outside.write_text("mine")
    for name in (".run.csv.part", "run.csv", "export"):
        (folder / name).symlink_to(outside)
    status, answer = client.put(project, "run.csv", CSV)
    assert (status, json.loads(answer)["file"]) == (200, "run_1.csv")
    client.act(project, "take", files=["run_1.csv"])
    client.settled(project)
    client.act(project, "export")
    assert "symbolic link" in client.settled(project)["stages"][-1]["error"]["what"]
    assert outside.read_text() == "mine"


def test_two_files_of_one_name_at_once_are_two_files(client: Client) -> None:
    project, found = client.project(), []
    bodies = [CSV * 200 + b"%d,1,1,1\n" % (1000 + k) for k in range(4)]
    threads = [
        threading.Thread(target=lambda b=b: found.append((b, client.put(project, "run.csv", b)))) for b in bodies
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    names = [json.loads(answer)["file"] for _, (status, answer) in found if status == 200]
    assert len(set(names)) == 4
    for body, (_, answer) in found:
        assert (client.server.folder / ".signlin" / project / json.loads(answer)["file"]).read_bytes() == body


def test_a_second_server_on_a_folder_is_refused(server: Callable[..., Server], tmp_path: Path) -> None:
    first = server(copied=False)
    command = [sys.executable, "-m", "signlin_ros.cli", "workbench", "--no-browser"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, timeout=120, check=False)
    said = done.stderr.decode().strip()
    assert done.returncode == 2
    assert f"project is open in another server, pid {first.process.pid}, port {first.client().port}" in said
    assert "\n" not in said
    first.stop(signal.SIGKILL)
    assert server().client().ask("GET", "/")[0] == 303


@pytest.mark.parametrize(
    "body",
    [b"[" * 100_000, b"[]", b"{", b'{"files": ' + b"[" * 90_000, b'"x"', b"x" * (5 << 20)],
    ids=["deep", "list", "open", "deep inside", "text", "megabytes"],
)
def test_a_request_that_is_none_is_refused_in_one_line(client: Client, one_project: str, body: bytes) -> None:
    project = one_project
    for path in ("do/take", "show/record", "live/take"):
        status, answer, _ = client.ask("POST", f"/p/{project}/{path}", body, {"x-signlin": "1"})
        assert status == 400, (path, answer)
        assert len(answer) < 300


def test_a_zip_of_many_names_and_a_long_formula_are_refused_in_one_line(client: Client, tmp_path: Path) -> None:
    project = client.project()
    with zipfile.ZipFile(tmp_path / "many.zip", "w") as archive:
        for k in range(20_000):
            archive.writestr(f"{k}.csv", "")
    for name, body in (("many.zip", (tmp_path / "many.zip").read_bytes()), ("run.csv", CSV)):
        client.act(project, "take", files=[json.loads(client.put(project, name, body)[1])["file"]])
    error = client.settled(project)["stages"][0]["error"]
    assert "20,000 files" in error["what"]
    assert len(error["what"]) < 300
    client.act(project, "drop", file="many.zip")
    assert client.settled(project)["stages"][1]["done"]
    for formula in ("*".join(["speed"] * 3000), "[" * 100_000, "(" * 100_000):
        status, answer = client.act(project, "map_signal", file="run.csv", signal="speed", formula=formula)
        said = client.settled(project)["stages"][0]["error"]["what"] if status == 200 else answer
        assert "fault" not in said
        assert len(said) < 300


def test_a_dropped_file_is_not_overwritten_by_a_model_that_is_made(client: Client) -> None:
    project = client.project()
    folder = client.server.folder / ".signlin" / project
    for name, body in (("model_1.yaml", MODEL.encode()), ("run.csv", CSV)):
        client.act(project, "take", files=[json.loads(client.put(project, name, body)[1])["file"]])
    client.settled(project)
    assert client.act(project, "keep", values={"J": 2.0})[0] == 200
    state = client.settled(project)
    assert state["model_name"] == "model_2.yaml"
    assert (folder / "model_1.yaml").read_text() == MODEL
    client.act(project, "undo")
    assert client.settled(project)["model_name"] == "model_1.yaml"
    assert client.act(project, "keep", values={"J": -1.0})[0] == 200  # refused by the model: no file is left of it
    assert client.settled(project)["stages"][4]["error"]
    assert sorted(f.name for f in folder.glob("*.yaml")) == ["model_1.yaml", "model_2.yaml"]


@pytest.fixture
def lasting(
    server: Callable[..., Server], hidden_effect: Path, longer: Callable[..., Path], tmp_path: Path
) -> tuple[Server, Client, str]:
    """A server, what asks it, and a project in which a diagnosis runs that lasts a while."""
    record = longer(hidden_effect / "estimation.csv", 8, tmp_path / "long.csv")
    given = server(str(hidden_effect / "model.yaml"), str(record), str(hidden_effect / "validation.csv"))
    client = given.client()
    project = client.ask("GET", "/")[2]["location"].rsplit("/", 1)[-1]
    assert client.settled(project)["stages"][1]["done"]
    assert client.act(project, "diagnose")[0] == 200
    return given, client, project


def test_what_is_refused_during_a_diagnosis_is_not_done(lasting: tuple[Server, Client, str], tmp_path: Path) -> None:
    _, client, project = lasting
    held = json.loads((tmp_path / ".signlin" / project / "state.json").read_text())["choices"]
    file = held["records"][0]["file"]
    for action, args in (
        ("drop", {"file": file}),
        ("role", {"file": held["records"][1]["file"]}),
        ("model", {"name": "dc_motor"}),
        ("cure", {"name": "none"}),
        ("map_signal", {"file": file, "signal": "speed", "column": "current"}),
        ("undo", {}),
        ("clear", {}),
    ):
        status, said = client.act(project, action, **args)
        assert (status, "still running" in said) == (400, True), (action, said)
    state = client.state(project)
    assert state["busy"]["stage"] == "diagnose"
    assert json.loads((tmp_path / ".signlin" / project / "state.json").read_text())["choices"] == held
    client.act(project, "cancel")
    blocks = {b["id"]: b for b in client.settled(project)["stages"]}
    assert not blocks["compare"]["why"]


def test_a_diagnosis_that_ended_with_the_server_is_told(lasting: tuple[Server, Client, str]) -> None:
    given, client, project = lasting
    while not client.state(project)["busy"]:
        pass
    given.stop(signal.SIGKILL)
    given.arguments = ("--port", str(client.port))
    given.start()
    state = given.client().state(project)
    assert "The server ended during 'diagnosing'" in state["stages"][3]["error"]["what"]
    assert state["busy"] is None


def test_projects_that_are_not_looked_at_hold_no_processes(server: Callable[..., Server]) -> None:
    psutil = pytest.importorskip("psutil")
    from signlin_ros.workbench.server import AWAKE

    given = server(copied=False)
    client, projects = given.client(), []
    for _ in range(6):
        projects.append(client.project())
        client.act(projects[-1], "take", files=[json.loads(client.put(projects[-1], "a.csv", CSV)[1])["file"]])
        client.settled(projects[-1])
    for _ in range(100):
        (template,) = psutil.Process(given.process.pid).children()
        workers = template.children()
        if len(workers) <= 2 * AWAKE:
            break
        client.state(projects[-1])
    assert len(workers) <= 2 * AWAKE
    status, answer, _ = client.ask("POST", f"/p/{projects[0]}/show/record", b"{}", {"x-signlin": "1"})
    assert (status, "plots" in answer) == (200, True)
