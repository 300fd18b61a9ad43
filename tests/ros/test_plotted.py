"""Single numbers with names: what they are called and that they are what the flat arrays hold."""

from __future__ import annotations

import re

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed: pip install 'signlin_ros[ros]'")

from signlin_ros.linearization import Linearizer
from signlin_ros.model import Model
from signlin_ros.nodes.monitor_logic import MonitorScore
from signlin_ros.nodes.plotted import Scalars, ScalarTopics, topic
from signlin_ros.nodes.told import Update
from signlin_ros.predict import without_dry_friction

MODEL = Model.load("dc_motor").with_options(with_position=True)
X, U = np.array([0.4, 12.0, 0.3]), np.array([2.0])


def scalars(model: Model) -> Scalars:
    return Scalars(model, Linearizer(without_dry_friction(model)))


def test_a_linear_model_by_names() -> None:
    result = Linearizer(MODEL)(X, U)
    found = scalars(MODEL).of_update(Update(0, 0, result))
    i, w, q = (MODEL.states.index(n) for n in ("current", "speed", "position"))
    assert found["A/speed/current"] == result.A[w, i]
    assert found["A/position/speed"] == result.A[q, w] == 1.0
    assert found["B/current/voltage"] == result.B[i, 0]
    friction = -MODEL.value("coulomb_friction.mu") / MODEL.value("J")  # of a speed far above zero
    assert found["friction/speed"] == pytest.approx(friction, rel=0.05)
    assert found["friction/current"] == pytest.approx(0.0, abs=1e-9)
    real = [found[f"pole_{k}/real"] for k in (1, 2, 3)]
    assert real == sorted(real, reverse=True)
    assert np.prod(np.array(real[1:])) == pytest.approx(
        np.linalg.det(result.A[np.ix_([i, w], [i, w])]), rel=1e-6
    )  # both real, the pole of the position is 0
    assert found["pole_2/imaginary"] == 0.0


def test_a_score_by_names() -> None:
    values = np.arange(15.0).reshape(5, 3)
    found = scalars(MODEL).of_score(MonitorScore(0, *values))
    assert found[f"error/{MODEL.states[1]}"] == 1.0
    assert found[f"error_without_friction/{MODEL.states[0]}"] == 3.0
    assert found[f"rms/{MODEL.states[2]}"] == 8.0
    assert found[f"fit/{MODEL.states[0]}"] == 12.0  # after the RMS of the model without friction


def test_all_that_is_told_has_a_topic_with_a_name_that_ros_takes() -> None:
    told = scalars(MODEL)
    update = told.of_update(Update(0, 0, Linearizer(MODEL)(X, U)))
    score = told.of_score(MonitorScore(0, *np.zeros((5, 3))))
    assert {*update, *score} == set(told.names)
    for name in (*told.names, topic("A", "elbow.position", "2nd joint")):
        assert re.fullmatch(r"[A-Za-z0-9_]+(/[A-Za-z0-9_]+)*", name)


class Peer:
    """A node whose publishers have as many listeners as said."""

    def __init__(self, heard: set[str]) -> None:
        self.heard, self.said, self.topics = heard, {}, []  # type: set[str], dict[str, float], list[str]

    def create_publisher(self, _: type, name: str, __: object) -> Peer.Publisher:
        self.topics.append(name)
        return Peer.Publisher(self, name)

    def destroy_publisher(self, publisher: Peer.Publisher) -> None:
        self.topics.remove(publisher.name)

    class Publisher:
        def __init__(self, peer: Peer, name: str) -> None:
            self.peer, self.name = peer, name

        def get_subscription_count(self) -> int:
            return int(self.name in self.peer.heard)

        def publish(self, message: object) -> None:
            self.peer.said[self.name] = message.data  # type: ignore[attr-defined]


def test_only_what_is_listened_to_is_sent_and_topics_follow_the_model() -> None:
    peer = Peer({"~/plot/A/speed/current"})
    topics = ScalarTopics(peer)
    topics.take_model(MODEL, Linearizer(without_dry_friction(MODEL)))
    result = Linearizer(MODEL)(X, U)
    topics.tell_update(Update(0, 0, result))
    topics.tell_score(MonitorScore(0, *np.zeros((5, 3))))
    assert peer.said == {"~/plot/A/speed/current": result.A[MODEL.states.index("speed"), MODEL.states.index("current")]}
    other = Model.load("mass_spring_damper")
    topics.take_model(other, Linearizer(without_dry_friction(other)))
    assert "~/plot/A/speed/current" not in peer.topics
    assert f"~/plot/error/{other.states[0]}" in peer.topics
    topics.close()
    assert peer.topics == []


def test_nobody_has_to_have_them() -> None:
    peer = Peer(set())
    topics = ScalarTopics(peer, wanted=False)
    topics.take_model(MODEL, Linearizer(without_dry_friction(MODEL)))
    topics.tell_update(Update(0, 0, Linearizer(MODEL)(X, U)))
    assert peer.topics == []
