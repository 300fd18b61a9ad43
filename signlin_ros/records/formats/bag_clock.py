"""The clocks of a bag: header stamps or times of reception, and where they jump back."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from signlin_ros.records.notes import Note

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Stamps = Mapping[str, Integers]
"""Topic -> (N,) ns."""

MIN_CLOCK_JUMP = 100_000_000
"""A clock that goes back by more than this (ns) from message to message begins anew; by less, messages came late."""
_ABSOLUTE = 100_000_000_000_000_000
"""A bag that starts later than this (ns, 3 years) counts from its first stamp: its clock is the calendar's.
"""
_CLOCKS_AGREE = 10_000_000_000
"""Header stamps further than this (ns) from the time of reception come from another clock."""


def restarts(received: Stamps, headers: Stamps, order: Stamps) -> tuple[list[int], list[Note]]:
    """The places in the bag, ``order`` (N,) of every topic's messages, at which a clock begins anew.

    Topics that jump within the time of each other's next message jump at the same place.
    """
    found: list[tuple[int, str, int]] = []
    for topic, places in order.items():
        for stamps in (received[topic], headers.get(topic, received[topic])):
            usable = stamps.size == places.size and stamps.size > 1 and not np.any(stamps == 0)
            backs = np.flatnonzero(np.diff(stamps) < -MIN_CLOCK_JUMP) + 1 if usable else np.array([], dtype=np.int64)
            late = [k for k in backs.tolist() if stamps[k:].size > 3 and np.median(stamps[k : k + 5]) < stamps[k - 1]]
            found += [(int(places[k]), topic, k + 1) for k in late]
    cuts: list[int] = []
    notes = []
    span = max((len(order) * 2, 4))
    for place, topic, number in sorted(found):
        if cuts and place - cuts[-1] <= span:
            continue
        cuts.append(place)
        said = f"{topic}: the clock goes back at message {number}: the bag is cut there"
        notes.append(Note(said, "cut", topic))
    return cuts, notes


def clocks(received: Stamps, headers: Stamps) -> tuple[dict[str, Integers], list[Note]]:
    """Stamps (N,) in ns of each topic that was read: of its headers where they can be used, else of
    reception.
    """
    headers = {topic: ns for topic, ns in headers.items() if ns.size}
    empty = [topic for topic, ns in headers.items() if _unfilled(ns, received[topic])]
    notes = [Note(f"{topic}: header stamps of 0; times of reception are used", "clock", topic) for topic in empty]
    headers = {topic: ns for topic, ns in headers.items() if topic not in empty}
    if len(headers) < sum(1 for ns in received.values() if ns.size):
        for topic in list(headers):
            why = _unusable(headers[topic], received[topic])
            if why:
                del headers[topic]
                notes.append(Note(f"{topic}: header stamps {why}; times of reception are used", "clock", topic))
    return {**received, **headers}, notes


def _unfilled(header: Integers, received: Integers) -> bool:
    """Tell whether header stamps (N,) in ns were left empty: 0 at another time than 0, where a simulation begins."""
    return bool(np.any((header < 0) | ((header == 0) & (received != 0))))


def _unusable(header: Integers, received: Integers) -> str:
    """Why header stamps (N,) in ns cannot be used beside topics that have none, or an empty text."""
    if abs(float(np.median(header - received))) > _CLOCKS_AGREE:
        return "of another clock than the bag's"
    back = np.flatnonzero(np.diff(header) < -MIN_CLOCK_JUMP)
    return f"jump back at message {back[0] + 2}" if back.size else ""


def seconds(
    stamps: Mapping[str, Integers], exact: tuple[Integers, Array] | None, notes: list[Note]
) -> dict[str, Array]:
    """Stamps in seconds: as written, or since the first message where the clock is the calendar's."""
    if exact is not None and all(np.isin(ns, exact[0]).all() for ns in stamps.values()):
        return {topic: exact[1][np.searchsorted(exact[0], ns)] for topic, ns in stamps.items()}
    start = min((int(ns.min()) for ns in stamps.values()), default=0)
    if start < _ABSOLUTE:
        start = 0
    else:
        notes.append(Note(f"time counts from the first message, {start / 1e9:.3f} s after 1970", "clock", "t"))
    return {topic: (ns - start) / 1e9 for topic, ns in stamps.items()}
