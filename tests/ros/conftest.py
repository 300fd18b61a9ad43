"""Processes, a peer in this process, and a domain for each test."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.forking import Copied, Zygote

PREFIX = Path(sys.prefix)
SHARE = PREFIX / "share" / "signlin_ros"
CONFIG = SHARE / "config"
BIN = PREFIX / "lib" / "signlin_ros"
PATIENCE = 60.0
"""Seconds to wait for what must happen; much more than it takes, for the sake of busy machines."""


class Process:
    """An executable from lib/signlin_ros, with its output in a file; a copy of ``zygote`` runs it if one is given."""

    def __init__(self, command: list[str], log: Path, env: dict[str, str], zygote: Zygote | None = None) -> None:
        self.log = log
        self.popen: subprocess.Popen[bytes] | Copied
        if zygote is not None:
            self.popen = zygote.start(command, log, env)
            return
        with log.open("wb") as out:
            self.popen = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT, env=env)

    @property
    def output(self) -> str:
        return self.log.read_text(errors="replace")

    @property
    def running(self) -> bool:
        return self.popen.poll() is None

    def stop(self, number: int = signal.SIGINT) -> int:
        """Send a signal, wait for the end, return the exit code; kill what does not end, for the tests to come."""
        if self.running:
            self.popen.send_signal(number)
        try:
            return self.popen.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.popen.kill()
            self.popen.wait()
            raise


class Graph:
    """One ROS domain: processes, and a peer node in this process to talk to them."""

    def __init__(self, domain: int, folder: Path, zygote: Callable[[], Zygote]) -> None:
        import rclpy
        from rclpy.context import Context
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        self.folder, self._zygote, self.processes = folder, zygote, list[Process]()
        self.env = {
            **os.environ,
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "FASTRTPS_DEFAULT_PROFILES_FILE": str(CONFIG / "fastdds_profile.xml"),
            "RCUTILS_LOGGING_BUFFERED_STREAM": "0",
        }
        os.environ.update({k: self.env[k] for k in self.env if k.startswith(("ROS_", "FASTRTPS"))})
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO, args=[])
        self.executor = SingleThreadedExecutor(context=self.context)
        self.node = rclpy.create_node("peer", context=self.context, use_global_arguments=False)
        self.executor.add_node(self.node)

    def close(self) -> None:
        for process in self.processes:
            process.stop(signal.SIGTERM)
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    # ---------------------------------------------------------------- processes

    def start(
        self,
        name: str,
        *parameters: str,
        model: str | Path = "dc_motor.yaml",
        namespace: str = "",
        sim_time: bool | None = False,
        copied: bool = True,
    ) -> Process:
        """Start an executable as ``ros2 run`` would: parameters are ``name:=value``; None: nothing said of the time.
        ``copied``: see `run`.
        """
        remap = ["-r", f"__ns:={namespace}"] if namespace else []
        clock = () if sim_time is None else (f"use_sim_time:={str(sim_time).lower()}",)
        options = [part for p in (*parameters, *clock) for part in ("-p", p)]
        arguments = ["--ros-args", "--params-file", str(CONFIG / model), *remap, *options]
        return self.run([str(BIN / name), *arguments], f"{name}_{len(self.processes)}", copied)

    def run(self, command: list[str], log: str, copied: bool = True) -> Process:
        """Start an executable; ``copied``: in a copy of a process that has imported already what it needs."""
        zygote = self._zygote() if copied else None
        self.processes.append(Process(command, self.folder / f"{log}.log", self.env, zygote))
        return self.processes[-1]

    # ---------------------------------------------------------------- the peer

    def wait(self, condition: Callable[[], Any], what: str = "", patience: float = PATIENCE) -> Any:
        """Spin until the condition holds; return its value."""
        end = time.monotonic() + patience
        while not (value := condition()):
            if time.monotonic() > end:
                logs = "\n".join(f"--- {p.log.name}\n{p.output}" for p in self.processes)
                pytest.fail(f"waited {patience:g} s in vain for {what or condition}\n{logs}")
            self.executor.spin_once(timeout_sec=0.02)
        return value

    def spin(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.01)

    def publisher(self, kind: Any, topic: str, depth: int = 50) -> Any:
        """A reliable publisher that has a subscriber already when it is returned."""
        publisher = self.node.create_publisher(kind, topic, depth)
        self.wait(publisher.get_subscription_count, f"a subscriber of {topic}")
        return publisher

    def collect(self, kind: Any, topic: str, latched: bool = False) -> list[Any]:
        """The list into which messages of a topic go from now on."""
        from rclpy.qos import DurabilityPolicy, QoSProfile

        durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        messages: list[Any] = []
        self.node.create_subscription(kind, topic, messages.append, QoSProfile(depth=1000, durability=durability))
        return messages

    def models(self, node: str = "/linearizer") -> list[Any]:
        """The list into which the messages of ``~/model`` of a linearizer go."""
        from std_msgs.msg import Float64MultiArray

        return self.collect(Float64MultiArray, f"{node}/model", latched=True)

    def call(self, kind: Any, service: str, request: Any) -> Any:
        """Call a service; again where the answer is lost, which happens just after it has appeared."""
        client = self.node.create_client(kind, service)
        self.wait(client.service_is_ready, service)
        try:
            for _ in range(10):
                future = client.call_async(request)
                self.executor.spin_until_future_complete(future, timeout_sec=3.0)
                if future.done():
                    return future.result()
        finally:
            self.node.destroy_client(client)
        pytest.fail(f"no answer from {service}")

    def set_parameter(self, name: str, value: Any, node: str = "/linearizer") -> Any:
        """The result of setting one parameter of a node."""
        from rcl_interfaces.srv import SetParameters
        from rclpy.parameter import Parameter

        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        return self.call(SetParameters, f"{node}/set_parameters", request).results[0]

    def diagnostics(self, messages: list[Any], text: str, node: str = "/linearizer") -> Any:
        """The first diagnostic status of a node from now on that has a text in its message."""
        messages.clear()

        def found() -> Any:
            statuses = [s for m in messages for s in m.status if s.name.startswith(f"{node}:")]
            return next((s for s in statuses if text in s.message), None)

        return self.wait(found, f"diagnostics {text!r}")


@pytest.fixture
def graph(tmp_path: Path, zygote: Callable[[], Zygote]) -> Iterator[Graph]:
    pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")
    if not (BIN / "linearizer").exists():
        pytest.fail(f"{BIN} is empty: install the package first (make install)")
    from domain_coordinator import domain_id

    with domain_id() as domain:
        graph = Graph(domain, tmp_path, zygote)
        try:
            yield graph
        finally:
            graph.close()
