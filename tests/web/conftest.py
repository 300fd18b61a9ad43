"""A server of its own for each test, and a window of Debian's Chromium to look at it; skipped where there is none."""

from __future__ import annotations

import http.client
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit

import pytest

from tests.forking import Copied, Zygote, when_asked

IMPORTED = (
    *("signlin_ros.workbench.server", "signlin_ros.workbench.worker", "signlin_ros.workbench.calls"),
    *("signlin_ros.cli.running", "signlin_ros.checks", "signlin_ros.guard", "signlin_ros.records.formats.csv"),
    *("signlin_ros.diagnosis.verbs", "signlin_ros.diagnosis.comparison"),
    *("uvicorn.lifespan.on", "uvicorn.loops.auto", "uvicorn.protocols.http.auto"),
)
"""What a server and its workers need."""
SERVED = Path(__file__).with_name("served.py")
CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
PATIENCE = 300.0
"""Seconds to wait for what must happen; much more than it takes, for the sake of busy machines."""
OFTEN, SELDOM = 0.05, 0.5
"""Seconds between two looks at a page, at first and after a while: each look costs the browser some milliseconds."""
PICTURES = Path(os.environ.get("SIGNLIN_SCREENSHOTS", "")) if os.environ.get("SIGNLIN_SCREENSHOTS") else None
"""Where pictures of the page go, if anywhere."""
PAGE = {"x-signlin": "1", "content-type": "application/json"}
"""What the page sends with whatever changes something."""
DROP = """
const input = document.createElement('input');
input.type = 'file'; input.multiple = true; input.id = 'dropped-by-test';
input.onchange = () => {
  const data = new DataTransfer();
  for (const file of input.files) data.items.add(file);
  input.remove();
  for (const kind of ['dragover', 'drop'])
    document.body.dispatchEvent(new DragEvent(kind, {dataTransfer: data, bubbles: true, cancelable: true}));
};
document.body.append(input);
return input;
"""
TOP = "return document.getElementById(arguments[0]).getBoundingClientRect().top"
CENTRE = """
document.getElementById(arguments[0]).scrollIntoView({block: 'center', behavior: 'instant'});
requestAnimationFrame(() => requestAnimationFrame(arguments[1])); // the page is told of it in the next frame
"""


class Server:
    """``signlin workbench`` in a folder; a copy of ``zygote`` runs it if one is given."""

    def __init__(self, folder: Path, *arguments: str, zygote: Zygote | None = None) -> None:
        self.folder, self.arguments, self._zygote = folder, arguments, zygote
        self.log = folder / "server.log"
        self.process: subprocess.Popen[bytes] | Copied
        self.start()

    def start(self) -> None:
        given = ["workbench", *self.arguments, "--no-browser"]
        before = len(self._printed())
        if self._zygote is not None:
            self.process = self._zygote.start([str(SERVED), *given], self.log, environment(), self.folder)
        else:
            command = [sys.executable, "-m", "signlin_ros.cli", *given]
            with self.log.open("ab") as out:
                self.process = subprocess.Popen(command, cwd=self.folder, stdout=out, stderr=out, env=environment())
        self.address = self._address(before)

    def _printed(self) -> list[str]:
        """Return the addresses that servers in this folder have printed."""
        return re.findall(r"workbench: (\S+)", self.log.read_text(errors="replace")) if self.log.exists() else []

    def _address(self, before: int) -> str:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            found = self._printed()
            if len(found) > before:
                return found[-1]
            assert self.process.poll() is None, self.log.read_text(errors="replace")
            time.sleep(0.05)
        pytest.fail("the server does not start")

    def client(self) -> Client:
        return Client(self)

    def stop(self, number: int = signal.SIGTERM) -> None:
        if self.process.poll() is None:
            self.process.send_signal(number)
        self.process.wait(PATIENCE)


class Client:
    """Asks a server, as any program on this machine could."""

    def __init__(self, server: Server) -> None:
        parts = urlsplit(server.address)
        self.host, self.port, self.server = str(parts.hostname), int(parts.port or 0), server

    def ask(
        self, method: str, path: str, body: bytes | None = None, headers: Mapping[str, str] | None = None
    ) -> tuple[int, str, Mapping[str, str]]:
        with closing(http.client.HTTPConnection(self.host, self.port, timeout=60)) as connection:
            connection.request(method, path, body, dict(headers or {}))
            answer = connection.getresponse()
            found = {k.lower(): v for k, v in answer.getheaders()}
            return answer.status, answer.read().decode(errors="replace"), found

    def project(self) -> str:
        return str(json.loads(self.ask("POST", "/new", b"{}", PAGE)[1])["id"])

    def put(self, project: str, name: str, body: bytes) -> tuple[int, str]:
        return self.ask("PUT", f"/p/{project}/files?name={quote(name, safe='')}", body, PAGE)[:2]

    def act(self, project: str, action: str, **args: Any) -> tuple[int, str]:
        return self.ask("POST", f"/p/{project}/do/{action}", json.dumps(args).encode(), PAGE)[:2]

    def state(self, project: str) -> Any:
        return json.loads(self.ask("GET", f"/p/{project}/state")[1])

    def settled(self, project: str) -> Any:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            state = self.state(project)
            if state["busy"] is None:
                return state
            time.sleep(0.1)
        pytest.fail("it does not come to an end")


def environment() -> dict[str, str]:
    root = str(Path(__file__).parents[2])
    own = {"XDG_STATE_HOME": str(Path(tempfile.gettempdir()) / "signlin_tests_state")}
    return {**own, **os.environ, "PYTHONPATH": os.pathsep.join([root, os.environ.get("PYTHONPATH", "")])}


@pytest.fixture(scope="session")
def web_zygote() -> Iterator[Callable[[], Zygote]]:
    """What servers and the templates of their workers are copied from; made where it is first needed."""
    with when_asked(IMPORTED) as only:
        yield only


def starting(folder: Path, zygote: Callable[[], Zygote]) -> Iterator[Callable[..., Server]]:
    """Yield what starts servers in a folder, and end them all.

    ``copied``: a copy of a process that has imported what it needs is the server, and another one its template.
    """
    pytest.importorskip("starlette", reason="the extra `web` is not installed")
    pytest.importorskip("uvicorn", reason="the extra `web` is not installed")
    running: list[Server] = []

    def start(*arguments: str, copied: bool = True) -> Server:
        running.append(Server(folder, *arguments, zygote=zygote() if copied else None))
        return running[-1]

    yield start
    for one in running:
        one.stop()


@pytest.fixture
def server(tmp_path: Path, web_zygote: Callable[[], Zygote]) -> Iterator[Callable[..., Server]]:
    yield from starting(tmp_path, web_zygote)


@pytest.fixture(scope="module")
def shared_server(tmp_path_factory: pytest.TempPathFactory, web_zygote: Callable[[], Zygote]) -> Iterator[Server]:
    """One server for tests that do not change what others see."""
    for start in starting(tmp_path_factory.mktemp("shared"), web_zygote):
        yield start()


@pytest.fixture(scope="module")
def client(shared_server: Server) -> Client:
    """What asks that server without a browser."""
    return shared_server.client()


@pytest.fixture(scope="module")
def one_project(client: Client) -> str:
    """A project of that server for tests that leave nothing in it which others would meet."""
    return client.project()


class Page:
    """A browser that looks at a server; counts the clicks."""

    def __init__(self, driver: Any) -> None:
        self.driver, self.clicks = driver, 0

    def open(self, address: str) -> None:
        self.driver.get(address)
        self.wait(lambda: self.driver.find_elements("id", "stage-use"), "the page")

    def wait(self, condition: Callable[[], Any], what: str, patience: float = PATIENCE) -> Any:
        from selenium.common.exceptions import NoSuchElementException, StaleElementReferenceException

        end, pause = time.monotonic() + patience, OFTEN
        while time.monotonic() < end:
            try:
                value = condition()
            except (NoSuchElementException, StaleElementReferenceException):  # not there yet, or just drawn anew
                value = None
            if value:
                return value
            time.sleep(pause)
            pause = min(1.5 * pause, SELDOM)
        body = self.driver.find_element("tag name", "body").text
        pytest.fail(f"waited {patience:g} s in vain for {what}\n{body[:3000]}")

    def click(self, identity: str, scroll: bool = True) -> None:
        """Click on what a user could click on; ``scroll``: after it has been brought to the middle of the window."""

        def clicked() -> bool:
            from selenium.common.exceptions import ElementClickInterceptedException

            for element in self.driver.find_elements("id", identity):
                if element.is_displayed() and element.is_enabled():
                    if scroll:
                        place = "arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})"
                        self.driver.execute_script(place, element)
                    try:
                        element.click()
                    except ElementClickInterceptedException:
                        return False
                    return True
            return False

        self.wait(clicked, f"{identity} to be clicked on")
        self.clicks += 1

    def choose(self, identity: str, value: str) -> None:
        """Choose an option of a list, and wait until what follows from it is done."""
        from selenium.webdriver.support.ui import Select

        def chosen() -> bool:
            Select(self.driver.find_element("id", identity)).select_by_value(value)
            return True

        with self.settling():
            self.wait(chosen, f"{value} of {identity} to be chosen")
        self.clicks += 2

    def chosen(self, identity: str) -> str:
        """Return the value of a list or a field."""
        (value,) = self.wait(lambda: (self.driver.find_element("id", identity).get_attribute("value"),), identity)
        return str(value)

    def shows(self, stage: str, text: str) -> None:
        """Wait until a text stands in a stage."""
        self.wait(lambda: text in self.stage(stage).text, f"{text!r} in {stage}")

    def write(self, identity: str, text: str) -> None:
        """Write something into a field in place of what stands there, and wait until what follows from it is done."""
        from selenium.webdriver import Keys

        with self.settling():
            self.type(identity, Keys.CONTROL, "a", Keys.NULL, text or Keys.DELETE, Keys.ENTER)

    def type(self, identity: str, *keys: str) -> None:
        """Press keys in a field."""

        from selenium.common.exceptions import ElementNotInteractableException

        def typed() -> bool:
            try:
                self.driver.find_element("id", identity).send_keys(*keys)
            except ElementNotInteractableException:  # it is folded, or just drawn anew
                unfold = "for (const one of document.querySelectorAll(`details:has(#${arguments[0]})`)) one.open = true"
                self.driver.execute_script(unfold, identity)
                return False
            return True

        self.wait(typed, f"{identity} to be written into")

    def press(self, identity: str) -> None:
        """Click, and wait until what follows from it is done."""
        with self.settling():
            self.click(identity)

    @contextmanager
    def settling(self) -> Iterator[None]:
        """Wait until something is changed, the server does nothing any more, and the page shows the state it is in."""
        before = self._state()["serial"]
        yield
        shown = "return document.documentElement.dataset.serial"

        def settled() -> bool:
            now = self._state()
            return now["serial"] != before and not now["busy"] and now["serial"] == self.driver.execute_script(shown)

        self.wait(settled, "the page to settle")

    def still(self) -> None:
        """Wait until all pictures in sight of the page are drawn and nothing changes its height any more."""
        undrawn = "return [...document.querySelectorAll('.plots:not([data-drawn])')].some((e) => e.checkVisibility())"
        held = "return [...document.querySelectorAll('.stage > .body')].some((e) => e.style.minHeight)"
        run = self.driver.execute_script
        self.wait(lambda: not run(undrawn) and not run(held), "the pictures to be drawn")

    def top(self, identity: str) -> float:
        """Return how far below the upper edge of the window an element is, in px."""
        return float(self.driver.execute_script(TOP, identity))

    def centre(self, identity: str) -> float:
        """Scroll an element to the middle of the window; return :meth:`top` of it."""
        self.driver.execute_async_script(CENTRE, identity)
        return self.top(identity)

    def _state(self) -> Any:
        ask = "const done = arguments[0]; fetch(`${location.pathname}/state`).then((r) => r.json()).then(done)"
        return self.driver.execute_async_script(ask)

    def drop(self, *files: Path) -> None:
        """Drop files onto the page."""
        self.driver.execute_script(DROP).send_keys("\n".join(str(f) for f in files))

    def stage(self, name: str) -> Any:
        return self.driver.find_element("id", f"stage-{name}")

    def done(self, name: str) -> None:
        """Wait until a stage is done; fail with its error if it has one."""

        def over() -> bool:
            error = self.driver.find_elements("id", f"error-{name}")
            if error and not self.busy:
                pytest.fail(f"{name}: {error[0].text}")
            return self.stage(name).get_attribute("data-done") == "true" and not self.busy

        self.wait(over, f"{name} to be done")

    @property
    def focused(self) -> str:
        """Return the id of the element that has the keyboard."""
        return str(self.driver.execute_script("return document.activeElement.id"))

    @property
    def busy(self) -> bool:
        return bool(self.driver.find_elements("css selector", "section[data-busy=true]"))

    def says(self, name: str) -> str:
        """Return the sentence of a stage; the page may replace it between finding and reading."""
        (text,) = self.wait(lambda: (self.driver.find_element("id", f"says-{name}").text,), f"what {name} says")
        return str(text)

    def error(self, name: str) -> str:
        """Wait for the error of a stage and return it."""

        def text() -> str:
            found = self.driver.find_elements("id", f"error-{name}")
            return str(found[0].text) if found else ""

        return str(self.wait(text, f"an error of {name}"))

    def picture(self, name: str, place: str = "") -> None:
        """Keep a picture of the window, if pictures are wanted."""
        if PICTURES is None:
            return
        PICTURES.mkdir(parents=True, exist_ok=True)
        if place:
            script = "document.getElementById(arguments[0]).scrollIntoView({block: 'start', behavior: 'instant'})"
            self.driver.execute_script(script, place)
        time.sleep(0.3)
        self.driver.save_screenshot(str(PICTURES / f"{name}.png"))


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """One browser for all tests of a process; each has a window of its own, and nothing is left in store."""
    pytest.importorskip("selenium", reason="selenium is not installed: pip install 'signlin_ros[dev]'")
    if CHROMIUM is None or DRIVER is None:
        pytest.skip("no Chromium: on Debian, apt-get install chromium chromium-driver")
    from selenium.common.exceptions import StaleElementReferenceException
    from selenium.webdriver import Chrome, ChromeOptions
    from selenium.webdriver.chrome.service import Service
    from selenium.webdriver.remote.webelement import WebElement

    class Placed(WebElement):
        """An element that is found anew where the page has drawn it anew since it was found."""

        place: tuple[Any, ...] = ()

        def _execute(self, command: str, params: Any = None) -> Any:
            try:
                return super()._execute(command, params)
            except StaleElementReferenceException:
                if not self.place:
                    raise
                self._id = self.parent.find_element(*self.place).id
                return super()._execute(command, params)

    class Browser(Chrome):
        _web_element_cls = Placed

        def find_element(self, *place: Any, **named: Any) -> WebElement:
            element = super().find_element(*place, **named)
            element.place = (*place, *named.values())
            return element

    options = ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in (
        *("--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"),
        *("--disable-component-update", "--disable-sync", f"--user-data-dir={tmp_path_factory.mktemp('profile')}"),
        *("--disable-dev-shm-usage", "--force-device-scale-factor=1", "--disable-extensions"),
        "--force-prefers-reduced-motion",  # scrolling in steps is drawn 30 times
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = Browser(options=options, service=Service(DRIVER))
    yield driver
    driver.quit()


@pytest.fixture
def browser(chromium: Any) -> Iterator[Callable[..., Page]]:
    home = chromium.current_window_handle

    def start(width: int = 1920, height: int = 1080) -> Page:
        chromium.switch_to.new_window("window")
        chromium.set_window_size(width, height)
        return Page(chromium)

    yield start
    for window in set(chromium.window_handles) - {home}:
        chromium.switch_to.window(window)
        _empty(chromium)
        chromium.close()
    chromium.switch_to.window(home)
    chromium.get_log("browser")  # what these windows have logged is forgotten too


def _empty(driver: Any) -> None:
    """Forget what a page has left behind: what it stored, its cookies, what it fetched."""
    origin = driver.execute_script("return location.origin")
    driver.execute_cdp_cmd("Storage.clearDataForOrigin", {"origin": origin, "storageTypes": "all"})
    driver.execute_cdp_cmd("Network.clearBrowserCookies", {})
    driver.execute_cdp_cmd("Network.clearBrowserCache", {})


@pytest.fixture(scope="session")
def hidden_effect(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with ``model.yaml`` that lacks dry friction, and two records of a motor that has it."""
    import numpy as np

    from signlin_ros.model import Model
    from signlin_ros.records import Record, Signal, write_record
    from signlin_ros.simulation import simulate

    folder = tmp_path_factory.mktemp("hidden")
    truth = Model.load("dc_motor")
    truth.without_effect("coulomb_friction").save(folder / "model.yaml")
    for name, seed in (("estimation", 5), ("validation", 6)):
        random = np.random.default_rng(seed)
        t = np.arange(1600) / 200.0
        waves = ((0.3, 1.6), (0.8, 1.0), (1.9, 0.5))
        voltage = sum(a * np.sin(2 * np.pi * f * t + random.uniform(0, 6)) for f, a in waves)
        run = simulate(truth, t, voltage[:, None])
        noise = {"current": 0.02, "speed": 0.1}
        signals = {n: Signal(run[n] + s * random.standard_normal(t.size), truth.units[n]) for n, s in noise.items()}
        write_record(Record(t, {"voltage": Signal(voltage, "V"), **signals}), folder / f"{name}.csv")
    return folder


@pytest.fixture(scope="session")
def longer() -> Callable[[Path, int, Path], Path]:
    """What writes a record several times over, one after the other: it takes long to diagnose."""
    import numpy as np

    def write(record: Path, times: int, out: Path) -> Path:
        header = record.read_text(encoding="utf-8").partition("\n")[0]
        once = np.loadtxt(record, delimiter=",", skiprows=1)
        period = np.zeros(once.shape[1])
        period[0] = once[-1, 0] - once[0, 0] + once[1, 0] - once[0, 0]
        np.savetxt(out, np.vstack([once + k * period for k in range(times)]), "%.9g", ",", header=header, comments="")
        return out

    return write
