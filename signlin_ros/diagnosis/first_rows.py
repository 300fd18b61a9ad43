"""What the tables of `compare`, `diagnose`, `add` and `refine` show of a model, a row each: errors of the motion over
the horizon, missing force in per cent of the effort, over noise that is the sensors' alone. The first rows are the same
in all four for the same files: the model as given, and its base parameters moved within their tolerances.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.diagnosis.case import Case
from signlin_ros.diagnosis.criteria import DEFAULT
from signlin_ros.diagnosis.motion import Fitted, Motion
from signlin_ros.diagnosis.motion.score import of_windows
from signlin_ros.diagnosis.results import Rung, Scores
from signlin_ros.diagnosis.witnesses import Tell, Witnesses, force_witness
from signlin_ros.threads import one_thread

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FirstRows:
    """``given``: the model as it is in its file; ``refitted``: its base parameters moved within their tolerances;
    ``horizon``: s over which motion is predicted.
    """

    given: Rung
    refitted: Rung
    horizon: float

    def to_json(self) -> dict[str, Any]:
        """Return what `signlin compare --json` prints of them."""
        return {"given": self.given.to_json(), "refitted": self.refitted.to_json(), "horizon": self.horizon}


def row(w: Witnesses, f: Fitted, left: Array | None) -> Rung:
    """Return the row of a fit; ``left``: the mean squared force (blocks,) that it leaves of unseen data."""
    case, noise = w.case, np.array(list(w.case.noise.values()))
    sides = ((case.problem, f.known_squares), (case.unseen, f.unseen_squares))
    first, second = (Scores(of_windows(problem, squares, noise)) for problem, squares in sides)
    return Rung(f.effects, first, second, w.as_percent(left), w.noise_percent if w.force else None)


def first_rows(w: Witnesses) -> FirstRows:
    """Return the first rows."""
    given, base = w.motion.given, w.base
    return FirstRows(row(w, given, w.as_written(given)), row(w, base, w.left(base)), w.case.horizon)


@one_thread
def refitted(c: Case, tell: Tell | None = None, cancelled: Callable[[], bool] | None = None) -> Witnesses:
    """Refit the base of a case and return what makes rows; ``tell`` of what is done, ``cancelled``: whether to stop."""
    tell = tell or (lambda what: None)
    motion = Motion(c.problem, c.unseen, DEFAULT, 1, tell, cancelled)
    return Witnesses(c, motion, force_witness(c, DEFAULT, tell))


__all__ = ["FirstRows", "first_rows", "refitted", "row"]
