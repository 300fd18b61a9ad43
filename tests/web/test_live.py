"""The live view on a running system: simulator and linearizer over ROS 2, seen in a browser."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from conftest import Page, Server

    from tests.forking import Zygote

PREFIX = Path(sys.prefix)
BIN, CONFIG = PREFIX / "lib" / "signlin_ros", PREFIX / "share" / "signlin_ros" / "config"


@pytest.fixture
def running(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, zygote: Callable[[], Zygote]) -> Iterator[None]:
    """A motor and its linearizer, on a domain of their own that the server of the test is on too."""
    pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")
    if not (BIN / "linearizer").exists():
        pytest.skip(f"{BIN} is empty: install the package first (make install)")
    from domain_coordinator import domain_id

    with domain_id() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", str(CONFIG / "fastdds_profile.xml"))
        drive = ("-p", "input_signal:=sine", "-p", "amplitude:=3.0", "-p", "input_period:=2.0")
        processes = []
        for name, more in (("linearizer", ()), ("plant_simulator", drive)):
            command = [str(BIN / name), "--ros-args", "-r", "__ns:=/arm", *more]
            command += ["--params-file", str(CONFIG / "dc_motor.yaml")]
            processes.append(zygote().start(command, tmp_path / f"{name}.log", dict(os.environ)))
        yield
        for process in processes:
            process.send_signal(signal.SIGTERM)
        for process in processes:
            process.wait(60)


@pytest.mark.ros
def test_a_running_system_is_seen_marked_and_taken(
    running: None, server: Callable[..., Server], browser: Callable[..., Page]
) -> None:
    page = browser()
    page.open(server("dc_motor", "--namespace", "/arm").address)
    page.wait(
        lambda: page.driver.find_element("css selector", "#model option").text.startswith("dc_motor"), "the model"
    )
    page.click("tab-live")
    live = page.driver.find_element("id", "live")

    def labels() -> list[Any]:
        return [p.get_attribute("aria-label") for p in live.find_elements("css selector", ".plot")]

    page.wait(lambda: any(str(x).startswith("speed [rad/s]") for x in labels()), "the speed")
    page.wait(lambda: any(str(x).startswith("voltage [V]") for x in labels()), "the voltage")
    page.wait(lambda: any(str(x).startswith("A[speed, speed] [1/s]") for x in labels()), "the entry of A that changes")
    page.wait(lambda: any(str(x).startswith("error of speed [rad/s]") for x in labels()), "the error of the prediction")
    page.wait(lambda: "valid range" in page.driver.find_element("id", "live-valid").text, "the valid range")
    page.click("mark")
    page.wait(lambda: "Marked" in page.driver.find_element("id", "live-marks").text, "the mark")
    page.click("pause")
    page.wait(lambda: page.driver.find_element("id", "pause").text == "Go on", "the pause")
    page.click("pause")
    frames = int(live.get_attribute("data-frames"))
    page.wait(lambda: int(live.get_attribute("data-frames")) > frames + 100, "frames to come")
    page.picture("live")
    page.click("take")
    page.wait(lambda: "Taken as live.csv" in page.driver.find_element("id", "live-marks").text, "the record")
    page.click("tab-bench")
    page.done("check")
    assert "live.csv" in page.stage("record").text
    page.click("do-compare")
    page.done("compare")
    messages = [m for m in page.driver.get_log("browser") if m["level"] == "SEVERE"]
    assert messages == []
