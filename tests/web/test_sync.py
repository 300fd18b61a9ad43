"""What the page shows is what the server knows last: in whatever order answers come, whatever gets lost on the way."""

from __future__ import annotations

import asyncio
import http.client
import json
import os
import shutil
import signal
import subprocess
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from signlin_ros.errors import InputError
from signlin_ros.workbench.lane import Lane, LaneCancelledError
from signlin_ros.workbench.live import Live
from signlin_ros.workbench.project import Project
from signlin_ros.workbench.session import MAX_PENDING_EVENTS, Session
from signlin_ros.workbench.template import WorkerTemplate

if TYPE_CHECKING:
    from conftest import Client, Page, Server

ROOT = Path(__file__).parents[2]
LATEST = """
import { latest } from "./sync.mjs";
let now = 0, shown = -1, open = 0, most = 0, asked = 0;
const wait = (ms) => new Promise((done) => setTimeout(done, ms));
const refresh = latest(async () => {
  const k = asked++;
  most = Math.max(most, ++open);
  await wait(5);
  const seen = now;
  await wait(k % 2 ? 1 : 30); // every other answer is slow
  open--;
  if (k % 5 === 3) throw new Error("lost");
  shown = seen;
});
for (now = 1; now < 20; now++) { refresh().catch(() => {}); await wait(4); }
const last = now;
let told = null;
try { await refresh(); } catch { await refresh(); }
console.log(JSON.stringify({ most, last, shown, asked }));
"""
SLOW = """
const real = window.fetch;
window.waiting = 0;
window.fetch = async (where, ...more) => {
  if (!String(where).endsWith("/state")) return real(where, ...more);
  window.waiting++;
  try {
    const answer = await real(where, ...more);
    if ((await answer.clone().json()).busy) await new Promise((done) => setTimeout(done, 1500));
    return answer;
  } finally {
    window.waiting--;
  }
};
"""
"""A browser in which answers that say that something runs come late, and that counts the answers it waits for."""


def test_what_is_shown_is_never_older_than_what_was_known(tmp_path: Path) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node: on Debian, apt-get install nodejs")
    shutil.copy(ROOT / "signlin_ros" / "workbench" / "static" / "sync.js", tmp_path / "sync.mjs")
    (tmp_path / "test.mjs").write_text(LATEST)
    done = subprocess.run([node, "test.mjs"], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=60)
    found = json.loads(done.stdout)
    assert found["most"] == 1
    assert found["shown"] == found["last"]
    assert found["asked"] < 20


def test_a_late_answer_does_not_hide_a_newer_one(
    server: Callable[..., Server], browser: Callable[..., Page], tmp_path: Path
) -> None:
    def seen() -> list[Any]:
        return page.driver.execute_script("return [window.waiting, document.documentElement.dataset.serial]")

    given, page = server(), browser(1280, 800)
    page.driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": SLOW})
    page.open(given.address)
    project = page.driver.current_url.rsplit("/", maxsplit=1)[-1]
    file = tmp_path / "odd.csv"
    file.write_text("t,a,b,c\n" + "".join(f"{0.01 * k:g},{k % 3},{k % 7},{k % 5}\n" for k in range(200)))
    for there in (True, False):
        if there:
            page.drop(file)
        else:
            page.click("drop-odd.csv")
        page.wait(lambda: bool(page.driver.find_elements("id", "drop-odd.csv")) == there, "the record")  # noqa: B023
        serial = given.client().settled(project)["serial"]
        page.wait(lambda: seen() == [0, serial], "the last state, and no answer to come")  # noqa: B023
        assert not page.busy
        assert bool(page.driver.find_elements("id", "drop-odd.csv")) == there


def _told(stream: http.client.HTTPResponse) -> Any:
    while not (line := stream.readline()).startswith(b"data:"):
        assert line, "the stream has ended"
    return json.loads(line[5:])


def test_a_silent_stream_says_which_state_there_is(client: Client) -> None:
    project = client.project()
    with closing(http.client.HTTPConnection(client.host, client.port, timeout=60)) as connection:
        connection.request("GET", f"/p/{project}/events")
        stream = connection.getresponse()
        while (told := _told(stream))["kind"] != "beat":
            pass
        assert told["serial"] == client.state(project)["serial"]
        client.act(project, "sample")
        assert client.settled(project)["serial"] != told["serial"]


def test_a_slow_page_is_told_to_look_again(tmp_path: Path) -> None:
    session = Session(Project.create(tmp_path))
    listener: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
    session.listeners.add(listener)
    for share in range(MAX_PENDING_EVENTS):
        session.tell("progress", busy=share)
    session.tell()
    assert listener.get_nowait() == {"kind": "state"}
    assert listener.empty()


def test_who_comes_while_the_server_ends_is_sent_away_at_once() -> None:
    async def run() -> None:
        live = Live()
        live.end()
        assert (await live.join()).get_nowait() == ""
        assert live._process is None

    asyncio.run(run())


def test_what_is_cancelled_before_it_began_does_not_begin(tmp_path: Path) -> None:
    async def run() -> None:
        lane = Lane(tmp_path)
        asked = [asyncio.create_task(lane.call("ready", {})) for _ in range(2)]  # one starts, the other one waits
        await asyncio.sleep(0)
        await lane.cancel()
        for one in asked:
            with pytest.raises(LaneCancelledError):
                await asyncio.wait_for(one, 60.0)
        await lane.cancel()

    asyncio.run(run())


@pytest.mark.parametrize("nice", [0, 5])
def test_what_takes_long_gives_way(tmp_path: Path, nice: int) -> None:
    mine = os.getpriority(os.PRIO_PROCESS, 0)

    async def run() -> int:
        lane = Lane(tmp_path, nice)
        await lane.call("ready", {})
        found = os.getpriority(os.PRIO_PROCESS, (await lane.start()).pid)
        await lane.cancel()
        return found

    assert asyncio.run(run()) == min(mine + nice, 19)  # no process is nicer than that


def test_workers_are_copies_of_a_template_that_is_started_again_where_it_ends(tmp_path: Path) -> None:
    mine = os.getpriority(os.PRIO_PROCESS, 0)

    async def run() -> None:
        template = WorkerTemplate()
        view, work = (Lane(tmp_path, nice, template) for nice in (0, 5))
        for lane in (view, work):
            assert (await lane.call("ready", {}))["ready"]
        first, second = [await lane.start() for lane in (view, work)]
        assert _parent(first.pid) == _parent(second.pid) != os.getpid()
        assert os.getpriority(os.PRIO_PROCESS, second.pid) == min(mine + 5, 19)
        await view.cancel()
        assert first.returncode == -signal.SIGKILL
        assert (await view.call("ready", {}))["ready"]
        os.kill(_parent(second.pid), signal.SIGKILL)
        assert await second.wait() == -signal.SIGKILL  # no worker outlives what the server asks for it
        assert (await work.call("ready", {}))["ready"]
        last = await work.start()
        unwanted = asyncio.create_task(template.worker(0))
        await asyncio.sleep(0)
        unwanted.cancel()
        assert (await Lane(tmp_path, 0, template).call("ready", {}))["ready"]  # a worker of its own, not that one
        await template.close()
        assert last.returncode == -signal.SIGKILL

    asyncio.run(run())


def _parent(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])


def test_a_job_is_cancelled_between_its_requests(tmp_path: Path) -> None:
    async def run() -> None:
        session = Session(Project.create(tmp_path))

        async def job() -> None:
            await session.cancel()
            await session.asked(session.view, "ready", {})

        session.start("compare", "comparing", job)
        with pytest.raises(InputError, match="still running"):
            session.start("compare", "comparing", job)
        while session.busy is not None:
            await asyncio.sleep(0.01)
        assert session.errors["compare"]["what"] == "Cancelled."
        assert "Nothing was changed" in session.errors["compare"]["do"]

        async def changed() -> None:
            session.project.change("add something")
            await job()

        session.start("add", "adding", changed)
        while session.busy is not None:
            await asyncio.sleep(0.01)
        assert '"add something" was done' in session.errors["add"]["do"]
        await session.close()

    asyncio.run(run())
