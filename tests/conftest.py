"""What every test shares: markers by folder, the order of a parallel run, processor time.

A parallel run (``make test``) hands out whole files, so that what a module keeps is made once; the diagnoses, which
take long, one by one; and all tests that start ROS processes to one worker, first of all and before the others, which
yield to it. Each of them has a ROS domain of its own. Then come those of the page, to one worker, which starts one
browser and one process to copy servers from: like those with ROS they mostly wait.
"""

from __future__ import annotations

import gc
import os
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from tests.forking import Zygote, spent_by_copies, when_asked

HERE = Path(__file__).parent
YIELD = 10
"""How much nicer the tests without ROS are than those with it: these watch the clock of a live system, and what takes
long in that gives way (`NICE` of nodes/diagnosing.py) to its own callbacks, not to other tests."""
LONGEST = {line: place for place, line in enumerate((HERE / "longest.txt").read_text(encoding="utf-8").splitlines())}
"""Diagnoses of more than 3 s of processor time (``SPENT`` of --junitxml), the longest first: begun last, one of them
would keep a single processor busy at the end. Names that are not there any more do no harm.
"""
GARBAGE = 20_000
"""Objects that are made, and kept, before garbage is looked for; after 700, Python's own number, it always is."""
PAGE = "web"
"""Group of the tests of the page."""
SPENT = "processor time"
NODES = (
    *("signlin_ros.nodes.linearizer_logic", "signlin_ros.nodes.controller_logic", "signlin_ros.nodes.monitor_logic"),
    *("signlin_ros.nodes.feed_logic", "signlin_ros.nodes.diagnoses", "signlin_ros.records"),
    *("sim_nodes.signals", "sim_nodes.playing", "sim_nodes.measuring"),
)
"""What nodes import; not rclpy, whose libraries start threads."""
BEGUN = pytest.StashKey[float]()
"""Processor time of this process and those that it has waited for, before a test."""

settings.register_profile("signlin", deadline=None)  # on a busy machine an example may take long: no failure
settings.load_profile("signlin")


def _in_a_worker(config: pytest.Config) -> bool:
    return hasattr(config, "workerinput")


# -------------------------------------------------------------------- markers and order


def _folder(path: Path) -> str:
    root = next((one for one in (HERE, HERE.parent) if one in path.parents), None)
    return path.relative_to(root).parts[0] if root else str(path.parent)


@pytest.hookimpl(tryfirst=True)  # before those that select by marker and give out by group
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    for item in items:
        if "graph" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.ros)
        if _folder(item.path) == "diagnosis":
            item.add_marker(pytest.mark.slow)
        limit = item.get_closest_marker("limit")
        if limit is not None:  # what has been mended is noticed
            item.add_marker(pytest.mark.xfail(reason=limit.args[0], strict=True))
    if _in_a_worker(config):
        for item in items:
            _give_group(item)
        # ROS, the page, then files, then what is handed out one by one, the longest first, and fills the gaps
        items.sort(key=_turn)


@pytest.hookimpl(tryfirst=True)
def pytest_collection() -> None:
    """Nothing of what is collected is garbage: to look for it among thousands of tests takes a third of the time."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Thousands of tests stay to the end: nobody looks through them for garbage again, nor often through what tests
    keep for each other.
    """
    gc.freeze()
    gc.set_threshold(GARBAGE)
    gc.enable()


def _give_group(item: pytest.Item) -> None:
    if item.get_closest_marker("xdist_group"):
        return
    if item.get_closest_marker("ros"):
        item.add_marker(pytest.mark.xdist_group("ros"))
    elif _folder(item.path) == "web":
        item.add_marker(pytest.mark.xdist_group(PAGE))
    elif _folder(item.path) != "diagnosis":
        item.add_marker(pytest.mark.xdist_group(item.path.relative_to(HERE.parent).as_posix()))


def _turn(item: pytest.Item) -> tuple[int, int]:
    if item.get_closest_marker("ros"):
        return 0, 0
    group = item.get_closest_marker("xdist_group")
    if group is None:
        return 3, LONGEST.get(item.nodeid, len(LONGEST))
    return (1, 0) if group.args[0] == PAGE else (2, 0)


# -------------------------------------------------------------------- processor time


_yielded = False


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    global _yielded  # noqa: PLW0603
    if _in_a_worker(item.config) and not _yielded and not item.get_closest_marker("ros"):
        os.nice(YIELD)
        _yielded = True
    return (yield)


def _processor_time() -> float:
    return sum(os.times()[:4]) + spent_by_copies()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> Iterator[None]:
    item.stash[BEGUN] = _processor_time()
    return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> Iterator[None]:
    try:
        return (yield)
    finally:  # told with the report of the teardown
        item.user_properties.append((SPENT, _processor_time() - item.stash[BEGUN]))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Tell the seconds of processor time that the tests of each folder took, with their fixtures and the processes that
    they started and ended. Collecting, and what lives as long as a worker (a browser), is not in it.
    """
    spent: defaultdict[str, float] = defaultdict(float)
    for reports in terminalreporter.stats.values():
        for report in reports:
            if getattr(report, "when", "") == "teardown":
                spent[_folder(HERE.parent / report.location[0])] += dict(report.user_properties).get(SPENT, 0.0)
    told = ", ".join(f"{folder} {seconds:.0f} s" for folder, seconds in sorted(spent.items()))
    terminalreporter.write_line(f"{SPENT}: {told or 'none'}")


# -------------------------------------------------------------------- what tests of nodes and of the page share


@pytest.fixture(scope="session")
def zygote() -> Iterator[Callable[[], Zygote]]:
    """What nodes are copied from; made where it is first needed."""
    with when_asked(NODES) as only:
        yield only


# -------------------------------------------------------------------- what a test must not leave behind


@pytest.fixture(autouse=True)
def catalogue_as_it_was() -> Iterator[None]:
    """Effects that a test registers from a file of its own do not compete in the diagnoses of other tests."""
    from signlin_ros.effects import EFFECTS

    before = dict(EFFECTS)
    yield
    for name in EFFECTS.keys() - before.keys():
        del EFFECTS[name]
