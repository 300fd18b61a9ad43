"""A force learned from records: its curve, the splines that the curve is made of, and the model that gets it."""

from __future__ import annotations

from signlin_ros.lazy import exports

_NAMES = {"Learned": "curve", "learn": "curve"} | dict.fromkeys(
    ("add_learned", "learn_missing", "with_learned"), "missing"
)
__getattr__, __dir__ = exports(__name__, _NAMES)
__all__ = ["Learned", "add_learned", "learn", "learn_missing", "with_learned"]
