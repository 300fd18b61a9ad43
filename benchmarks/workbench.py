"""How quick the workbench is in a real browser: first view, sliders, a large record, zooming.

    python -m benchmarks.workbench [--pictures DIR]

Prints one line for each figure, with what is asked of it, and the load of the machine. Needs Chromium and its driver
(on Debian: apt-get install chromium chromium-driver) and the extras ``web`` and ``dev``.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ARGUMENTS = (
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--disable-dev-shm-usage", "--window-size=1920,1080"),
)
RUNNING: list[subprocess.Popen[Any]] = []
"""What was started, and is ended whatever happens."""
LARGE, LONG = 1_000_000, 10_000
FULL = 65.0
"""Seconds after which the live view keeps as many samples as it ever does."""


def browser(folder: Path) -> Any:
    from selenium.webdriver import Chrome, ChromeOptions
    from selenium.webdriver.chrome.service import Service

    options = ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for argument in (*ARGUMENTS, f"--user-data-dir={folder / 'profile'}"):
        options.add_argument(argument)
    driver = Chrome(options=options, service=Service(shutil.which("chromedriver")))
    driver.get("about:blank")
    return driver


def start(folder: Path, *arguments: str) -> tuple[subprocess.Popen[str], str]:
    command = [sys.executable, "-m", "signlin_ros.cli", "workbench", *arguments, "--no-browser"]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True)
    RUNNING.append(process)
    line = process.stdout.readline() if process.stdout else ""
    return process, line.split()[1]


def until(condition: Callable[[], Any], patience: float = 120.0) -> Any:
    end = time.monotonic() + patience
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.01)
    raise TimeoutError("it does not come")


def shown(driver: Any, selector: str) -> Any:
    return until(lambda: driver.find_elements("css selector", selector))[0]


class Spent:
    """Processor time of this process's children, the browser's among them: what a busy machine does not change."""

    def __init__(self) -> None:
        self._before = self._now()

    def _now(self) -> float:
        import psutil

        total = 0.0
        for process in psutil.Process().children(recursive=True):
            with contextlib.suppress(psutil.Error):
                times = process.cpu_times()
                total += times.user + times.system
        return total

    def __call__(self) -> float:
        return self._now() - self._before


def told(what: str, value: float, unit: str, asked: str) -> None:
    load = os.getloadavg()[0]
    print(f"{what:<58}{value:10.3g} {unit:<7} asked: {asked:<12} load {load:.1f} on {os.cpu_count()} cores", flush=True)


def large_record(file: Path) -> None:
    """Write 1,000,000 samples of 7 signals and the time."""
    random = np.random.default_rng(0)
    t = np.arange(LARGE) * 1e-3
    waves = [np.sin(2 * np.pi * (0.1 + 0.05 * k) * t) + 0.01 * random.standard_normal(LARGE) for k in range(7)]
    header = "t,voltage,current,speed,position,temperature,aux1,aux2"
    np.savetxt(file, np.column_stack([t, *waves]), fmt="%.6g", delimiter=",", header=header, comments="")


def motor_record(folder: Path) -> tuple[Path, Path]:
    """Write a model with dry friction and a record of 10,000 samples."""
    from signlin_ros.model import Model
    from signlin_ros.records import Record, Signal, write_record
    from signlin_ros.simulation import simulate

    model, t = Model.load("dc_motor"), np.arange(LONG) / 500.0
    voltage = 2.0 * np.sin(2 * np.pi * 0.4 * t) + np.sin(2 * np.pi * 1.7 * t)
    run = simulate(model, t, voltage[:, None])
    random = np.random.default_rng(1)
    signals = {"voltage": Signal(voltage, "V")}
    for name, sigma in {"current": 0.02, "speed": 0.1}.items():
        signals[name] = Signal(run[name] + sigma * random.standard_normal(LONG), model.units[name])
    write_record(Record(t, signals), folder / "run.csv")
    model.save(folder / "motor.yaml")
    return folder / "motor.yaml", folder / "run.csv"


def first_view(driver: Any, folder: Path) -> None:
    before, spent = time.perf_counter(), Spent()
    process, address = start(folder)
    driver.get(address)
    shown(driver, "#stage-use")
    told("first view, from the start of the process", time.perf_counter() - before, "s", "2 s")
    told("  processor time of it, server, workers and browser", spent(), "s", "")
    process.terminate()
    process.wait()


def large(driver: Any, folder: Path, file: Path) -> None:
    process, address = start(folder)
    driver.get(address)
    shown(driver, "#stage-use")
    until(lambda: len(driver.find_elements("css selector", "#model option")) > 3)
    chooser = driver.find_element("id", "files")
    before, spent = time.perf_counter(), Spent()
    chooser.send_keys(str(file))
    shown(driver, "#plots-record[data-drawn]")
    told("1,000,000 samples x 8 columns on the screen after the drop", time.perf_counter() - before, "s", "5 s")
    told("  processor time of it, server, workers and browser", spent(), "s", "")
    script = """
      const done = arguments[0], plots = document.getElementById('plots-record'), from = performance.now();
      const before = plots.dataset.drawn;
      plots.dispatchEvent(new KeyboardEvent('keydown', {key: '+'}));
      const look = () => plots.dataset.drawn !== before ? requestAnimationFrame(() => done(performance.now() - from))
        : setTimeout(look, 1);
      look();
    """
    until(lambda: not driver.find_elements("css selector", "section[data-busy=true]"))
    points = driver.execute_script("return document.getElementById('plots-record').dataset.points")
    told("points of a curve at most", float(points), "", "5000")
    spent = Spent()
    zooms = [driver.execute_async_script(script) for _ in range(15)]
    told("zoom, median of 15", float(np.median(zooms)), "ms", "200 ms")
    told("zoom, slowest of 15", float(np.max(zooms)), "ms", "")
    told("  processor time of one", 1000 * spent() / 15, "ms", "")
    process.terminate()
    process.wait()


def sliders(driver: Any, folder: Path, pictures: Path | None) -> None:
    model, record = motor_record(folder)
    process, address = start(folder, str(model), str(record))
    driver.get(address)
    until(lambda: driver.find_element("id", "stage-check").get_attribute("data-done") == "true")
    driver.execute_script("document.getElementById('stage-add').scrollIntoView()")
    driver.execute_script("document.getElementById('tuner').open = true")
    shown(driver, "#plots-tune[data-drawn]")
    script = """
      const done = arguments[1], plots = document.getElementById('plots-tune'), before = plots.dataset.drawn;
      const slider = document.getElementById('slide-coulomb_friction.mu');
      slider.value = arguments[0];
      const from = performance.now();
      slider.dispatchEvent(new Event('input'));
      const look = () => plots.dataset.drawn !== before ? requestAnimationFrame(() => done(performance.now() - from))
        : setTimeout(look, 1);
      look();
    """
    driver.execute_async_script(script, 100)
    spent = Spent()
    times = [driver.execute_async_script(script, 100 + 5 * k) for k in range(1, 31)]
    told("a dragged parameter redraws, 10,000 samples, median of 30", float(np.median(times)), "ms", "100 ms")
    told("a dragged parameter redraws, 10,000 samples, slowest", float(np.max(times)), "ms", "")
    told("  processor time of one", 1000 * spent() / 30, "ms", "")
    if pictures:
        driver.save_screenshot(str(pictures / "sliders.png"))
    process.terminate()
    process.wait()


PUBLISH = """
import sys, time, rclpy
from std_msgs.msg import Float64MultiArray
from signlin_ros.nodes.qos import RELIABLE
rclpy.init(); node = rclpy.create_node("source"); out = node.create_publisher(Float64MultiArray, "state", RELIABLE)
begin, k = time.monotonic(), 0
while True:
    k += 1
    out.publish(Float64MultiArray(data=[float(k % 100 + j) for j in range(8)]))
    time.sleep(max(begin + k / 1000.0 - time.monotonic(), 0.0))
"""
BARE = """
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Float64MultiArray
from signlin_ros.nodes.qos import SENSORS
rclpy.init(); node = rclpy.create_node("bare")
node.create_subscription(Float64MultiArray, "state", lambda m: None, SENSORS)
executor = SingleThreadedExecutor(); executor.add_node(node)
while True: executor.spin_once(timeout_sec=0.05)
"""


def live(driver: Any, folder: Path, seconds: float) -> None:
    """Compare the processor time of feed and server with that of a subscription that does nothing, at the same time."""
    import psutil

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ["ROS_DOMAIN_ID"] = str(100 + os.getpid() % 100)
    source = subprocess.Popen([sys.executable, "-c", PUBLISH])
    bare = subprocess.Popen([sys.executable, "-c", BARE])
    RUNNING.extend((source, bare))
    process, address = start(folder)
    driver.get(address)
    shown(driver, "#stage-use")
    driver.execute_script("document.getElementById('tab-live').click()")
    until(lambda: int(driver.find_element("id", "live").get_attribute("data-frames") or 0) > 20)
    server = psutil.Process(process.pid)
    feed = next(p for p in server.children() if "signlin_ros.nodes.feed" in p.cmdline())
    time.sleep(min(FULL, seconds))
    held = [p.memory_info().rss for p in (server, feed)]
    before, begun = _seen(driver), time.monotonic()
    alone, spent = _loads_of([[psutil.Process(bare.pid)], [server, feed]], seconds)
    lasted = time.monotonic() - begun
    frames, samples = (now - then for now, then in zip(_seen(driver), before, strict=True))
    told("a bare subscription to 1 kHz x 8", 100 * alone, "%", "")
    told("live, subscriber and server beyond it", 100 * (spent - alone), "%", "40 %")
    told("live, frames a second on the page", frames / lasted, "", "20")
    told("live, samples a second that arrived", samples / lasted, "", "1000")
    grown = sum(p.memory_info().rss for p in (server, feed)) - sum(held)
    told(f"live, memory grown in {seconds:g} s", grown / 2**20, "MiB", "flat")
    points = [int(p.get_attribute("data-points") or 0) for p in driver.find_elements("css selector", "#live .plot")]
    told("live, points of a curve at most", float(max(points)), "", "5000")
    for one in (process, source, bare):
        one.terminate()
        one.wait()


def _seen(driver: Any) -> list[int]:
    """Return how many frames and samples the page has been told of."""
    element = driver.find_element("id", "live")
    return [int(element.get_attribute(f"data-{name}") or 0) for name in ("frames", "samples")]


def _loads_of(groups: list[list[Any]], seconds: float) -> list[float]:
    """Return the share of a core that each group of processes takes, at the same time."""

    def spent() -> list[float]:
        return [float(sum(sum(p.cpu_times()[:2]) for p in group)) for group in groups]

    before, begun = spent(), time.monotonic()
    time.sleep(seconds)
    lasted = time.monotonic() - begun
    return [(now - then) / lasted for now, then in zip(spent(), before, strict=True)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("only", nargs="*", choices=["first", "sliders", "large", "live", []])
    parser.add_argument("--seconds", type=float, default=60.0, help="How long the live view is watched.")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        driver = browser(folder)
        try:
            for part in options.only or ("first", "sliders", "large", "live"):
                (folder / part).mkdir()
                if part == "first":
                    first_view(driver, folder / part)
                elif part == "sliders":
                    sliders(driver, folder / part, options.pictures)
                elif part == "live":
                    live(driver, folder / part, options.seconds)
                else:
                    large_record(folder / "large.csv")
                    large(driver, folder / part, folder / "large.csv")
        finally:
            for process in RUNNING:
                process.terminate()
                process.wait()
            driver.quit()


if __name__ == "__main__":
    main()
