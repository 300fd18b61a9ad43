"""What must not happen: other sites, other machines, files outside of the project, code, bombs, HTML in names."""

from __future__ import annotations

import asyncio
import http.client
import json
import re
import socket
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from conftest import Client, Page, Server

CSV = b"t,voltage,current,speed\n" + b"".join(b"%g,1,0.5,%g\n" % (0.01 * k, 0.1 * k) for k in range(100))
PAGE = {"x-signlin": "1", "content-type": "application/json"}


def test_only_this_page_may_ask(client: Client) -> None:
    own = f"{client.host}:{client.port}"
    assert client.ask("GET", "/")[0] == 303
    for host in ("evil.example", "evil.example:80", "127.0.0.1.evil.example", ""):
        assert client.ask("GET", "/", headers={"Host": host})[0] == 403
    for origin in ("http://evil.example", "null", f"http://{client.host}:1", f"https://evil.example/{own}"):
        assert client.ask("GET", "/", headers={"Origin": origin})[0] == 403
        assert client.ask("POST", "/new", b"{}", {**PAGE, "Origin": origin})[0] == 403
    assert client.ask("POST", "/new", b"{}", {**PAGE, "Sec-Fetch-Site": "cross-site"})[0] == 403
    assert client.ask("POST", "/new", b"{}")[0] == 403
    assert client.ask("POST", "/new", b"{}", {**PAGE, "Origin": f"http://{own}"})[0] == 200


def test_only_this_machine_is_listened_to(client: Client) -> None:
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", client.port), timeout=5)


def test_another_address_needs_the_token(server: Callable[..., Server]) -> None:
    given = server("--host", "127.0.0.2")
    client, token = given.client(), given.address.split("token=")[1]
    assert len(token) >= 32
    assert client.ask("GET", "/")[0] == 403
    assert client.ask("GET", "/?token=wrong")[0] == 403
    assert client.ask("GET", "/", headers={"Cookie": "signlin_token=wrong"})[0] == 403
    status, _, headers = client.ask("GET", f"/?token={token}")
    assert (status, headers["location"]) == (303, "/")
    assert "httponly" in headers["set-cookie"].lower()
    assert "samesite=strict" in headers["set-cookie"].lower()
    cookie = headers["set-cookie"].split(";")[0]
    assert client.ask("GET", "/", headers={"Cookie": cookie})[0] == 303


def test_nothing_is_loaded_from_elsewhere(client: Client) -> None:
    project = client.project()
    _, page, headers = client.ask("GET", f"/p/{project}")
    assert "script-src 'self';" in headers["content-security-policy"]
    assert "unsafe" not in headers["content-security-policy"]
    for name in re.findall(r'(?:src|href)="([^"#]+)"', page):
        assert name.startswith(("/static/", "data:"))
        if name.startswith("/static/"):
            status, text, _ = client.ask("GET", name)
            assert status == 200
            assert not re.findall(
                r"https?://(?!www\.w3\.org/)[\w.]+", text.replace("https://github.com/leeoniya/uPlot", "")
            )


@pytest.mark.parametrize(
    "name",
    [
        "../../../outside.csv",
        "..\\..\\outside.csv",
        "/etc/outside.csv",
        ".hidden.csv",
        "-rf.csv",
        "a\x00b\n\r.csv",
        "x" * 4000 + ".csv",
        "<img src=x onerror=alert(1)>.csv",
        "état — œuvre.csv",
        "...csv",
        "con|aux?*.csv",
    ],
)
def test_a_file_stays_in_its_project_whatever_it_is_called(client: Client, one_project: str, name: str) -> None:
    project = one_project
    status, answer = client.put(project, name, CSV)
    folder = client.server.folder / ".signlin" / project
    if status == 200:
        file = json.loads(answer)["file"]
        assert (folder / file).read_bytes() == CSV
        assert not file.startswith((".", "-"))
        assert not set(file) & set("/\\<>\x00\n\r|?*:\"'")
        assert len(file) < 100
    else:
        assert "no record and no model" in answer
    assert all(f.parent.parent.name == ".signlin" for f in client.server.folder.parent.rglob("*outside*.csv"))


@pytest.mark.parametrize("name", ["run.py", "page.html", "noext", "x.csv.exe", ".csv"])
def test_other_kinds_of_files_are_refused(client: Client, one_project: str, name: str) -> None:
    status, answer = client.put(one_project, name, CSV)
    assert status == 400
    assert "allowed: .csv" in answer


def test_an_empty_and_a_huge_file_are_refused(client: Client) -> None:
    project = client.project()
    assert "empty" in client.put(project, "empty.csv", b"")[1]
    with closing(http.client.HTTPConnection(client.host, client.port, timeout=60)) as connection:
        connection.putrequest("PUT", f"/p/{project}/files?name=huge.csv")
        for key, value in {**PAGE, "content-length": str(600 << 20)}.items():
            connection.putheader(key, value)
        connection.endheaders()
        answer = connection.getresponse()
        assert answer.status == 400
        assert "512 MiB" in answer.read().decode()
    assert [f.name for f in (client.server.folder / ".signlin" / project).iterdir() if f.is_file()] == ["state.json"]


def test_a_file_that_says_nothing_of_its_size_is_stopped_on_the_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("starlette")
    from starlette.requests import Request

    from signlin_ros.errors import InputError
    from signlin_ros.workbench import receiving

    monkeypatch.setattr(receiving, "MAX_FILE_BYTES", 1000)
    given = iter(range(1000))

    async def receive() -> dict[str, Any]:
        next(given)
        return {"type": "http.request", "body": b"x" * 400, "more_body": True}

    request = Request({"type": "http", "method": "PUT", "headers": [], "query_string": b"", "path": "/"}, receive)
    with pytest.raises(InputError, match="too large"):
        asyncio.run(receiving.received(request, tmp_path, "a.csv"))
    assert next(given) <= 4
    assert list(tmp_path.iterdir()) == []


def test_files_outside_are_not_to_be_had(client: Client) -> None:
    project = client.project()
    for path in (
        "/static/../server.py",
        "/static/%2e%2e/server.py",
        "/static/..%2fserver.py",
        f"/p/{project}/export/..%2fstate.json",
        f"/p/{project}/export/state.json",
        "/p/..%2f..%2fetc/state",
        "/p/aaaaaaaaaaaa/state",
    ):
        assert client.ask("GET", path)[0] in (400, 404), path
    for name in ("../state.json", "/etc/passwd", "state.json/../state.json", "nothing.csv"):
        status, answer = client.act(project, "take", files=[name])
        assert status == 404, answer
    assert client.act(project, "__import__")[0] == 404
    assert client.act(project, "model", name="/etc/passwd")[0] == 404


BOMB = "a: &a [x,x,x,x,x,x,x,x,x]\nb: &b [*a,*a,*a,*a,*a,*a,*a,*a,*a]\nc: &c [*b,*b,*b,*b,*b,*b,*b,*b,*b]\n/**: *c\n"
MODEL = "/**:\n  ros__parameters:\n    plant: dc_motor\n    parameters: {R_a: 1, L_a: 0, K_t: 1, K_m: 1, B: 0, J: 1}\n"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (BOMB, "anchors"),
        ("[" * 5000, "levels"),
        (f"{MODEL}    effect_files: [evil.py]\n", "code is not taken from the browser"),
        (f'{MODEL}    "effect_files": ["../evil.py"]\n', "code is not taken from the browser"),
        (f"{MODEL}    x: !!python/object/apply:os.system ['touch hacked']\n", "not a YAML file"),
        (f"{MODEL}    signals: {{speed: '{'x' * (1 << 20)}'}}\n", "bytes"),
        ("just text", "ROS 2 parameter file"),
    ],
    ids=["bomb", "deep", "code", "code in quotes", "object", "megabytes", "text"],
)
def test_a_model_file_from_the_browser_is_looked_at_first(
    client: Client, one_project: str, text: str, why: str
) -> None:
    project = one_project
    (client.server.folder / ".signlin" / project / "evil.py").write_text("open('hacked', 'w')")
    name = json.loads(client.put(project, "model.yaml", text.encode())[1])["file"]
    assert client.act(project, "take", files=[name])[0] == 200
    state = client.settled(project)
    assert why in state["stages"][0]["error"]["what"]
    assert state["model"] is None
    assert not list(client.server.folder.rglob("hacked"))


def test_sessions_do_not_mix(client: Client) -> None:
    one, other = client.project(), client.project()
    for project, name in ((one, "mine.csv"), (other, "yours.csv")):
        file = json.loads(client.put(project, name, CSV)[1])["file"]
        client.act(project, "take", files=[file])
    assert [r["name"] for r in client.settled(one)["records"]] == ["mine.csv"]
    assert [r["name"] for r in client.settled(other)["records"]] == ["yours.csv"]
    assert client.act(other, "take", files=["mine.csv"])[0] == 404
    assert client.act(other, "drop", file="mine.csv")[0] == 404


def test_html_in_names_is_text(client: Client, browser: Callable[..., Page], tmp_path: Path) -> None:
    evil = "<img src=x onerror=document.title='hacked'>"
    file = tmp_path / "<b onclick=alert(1)>x.csv"
    file.write_text(f"t,voltage,speed,{evil}\n" + "".join(f"{0.01 * k},1,{k},2\n" for k in range(50)))
    page = browser()
    page.open(client.server.address)
    page.drop(file)
    page.wait(lambda: "onerror" in page.stage("record").text or "50" in page.stage("record").text, "the record")
    page.wait(lambda: page.driver.find_elements("css selector", "#plots-record canvas"), "the curves")
    assert page.driver.find_elements("css selector", "main img, main b[onclick]") == []
    assert page.driver.title == "signlin workbench"
