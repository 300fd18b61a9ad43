"""The whole state from what is measured, causally: an extended Kalman filter on the model's own equations."""

from __future__ import annotations

from signlin_ros.lazy import exports

_NAMES = {"StateEstimate": "observer", "KalmanObserver": "observer", "observed_states": "observer"}
__getattr__, __dir__ = exports(__name__, _NAMES)
__all__ = ["KalmanObserver", "StateEstimate", "observed_states"]
