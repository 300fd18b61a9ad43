"""The motion witness: simulation with an observer, fitted to known records and judged on unseen ones."""

from signlin_ros.diagnosis.motion.fitted import Fitted
from signlin_ros.diagnosis.motion.running import CancelledError
from signlin_ros.diagnosis.motion.witness import Motion

__all__ = ["CancelledError", "Fitted", "Motion"]
