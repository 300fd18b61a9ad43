"""The main job for real: a plant and two linearizers as processes over ROS 2, and what their models are worth.

    python -m signlin_ros.demo --output out

Starts ``plant_simulator`` (the non-smooth DC motor under a square voltage) and two ``linearizer``s, one with the
operating point at the start of each period and one at its predicted midpoint; listens; and holds every published
A_k, B_k, c against what the plant did in the next update period. ``python -m signlin_ros.demo.live`` improves a model
while the machine runs.
"""

from signlin_ros.demo.processes import PUBLISH_RATE, DemoError, prefix
from signlin_ros.demo.worth import (
    DemoRecord,
    Rivals,
    largest_difference,
    on_grid,
    predict_linear,
    rms,
    typical,
    windows,
)

__all__ = [
    "PUBLISH_RATE",
    "DemoError",
    "DemoRecord",
    "Rivals",
    "largest_difference",
    "on_grid",
    "predict_linear",
    "prefix",
    "rms",
    "typical",
    "windows",
]
