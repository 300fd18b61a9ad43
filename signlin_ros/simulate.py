"""The old place of `signlin_ros.simulation`; it works until version 0.2, and warns."""

from __future__ import annotations

from signlin_ros._moved import moved

moved(__name__, "signlin_ros.simulation")
