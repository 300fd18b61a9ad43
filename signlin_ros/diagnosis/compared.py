"""What a comparison returns: scores by channel, where the model fails, and the curves behind them."""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.comparison.inverse import InverseError
from signlin_ros.comparison.locate import Region
from signlin_ros.comparison.missing import Missing
from signlin_ros.comparison.residuals import ResidualTest
from signlin_ros.comparison.scores import Score, follows_nothing, unfollowed
from signlin_ros.diagnosis.results import FirstRows
from signlin_ros.errors import InputError, joined
from signlin_ros.lazy import drawn_by, frame
from signlin_ros.model import Model
from signlin_ros.noise import Noise

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ChannelScores:
    """A measured channel: unit, ``sigma`` of its sensor's noise, by which all verbs tell errors, ``noise`` with the
    colour that what the model leaves tells of it, and what its predictions are worth (None: see the notes).
    """

    unit: str
    sigma: float
    noise: Noise
    free_run: Score | None
    windowed: Score | None

    def to_json(self) -> dict[str, Any]:
        """Return the channel as the contract writes it, with the noise's colour and step."""
        noise = {"noise": self.sigma, "noise_correlation": self.noise.rho, "quantum": self.noise.quantum}
        scores = {"free_run": self.free_run, "windowed": self.windowed}
        return {"unit": self.unit, **noise, **{name: s.to_json() if s else None for name, s in scores.items()}}


@dataclass(frozen=True, eq=False)
class Traces:
    """A stretch as measured and as predicted, (T, channels) each, NaN where there is nothing; ``states`` (T, n): causal
    estimates of an observer; ``residual``: innovations of one that trusts the model.
    """

    source: str
    t: Array
    u: Array
    measured: Array
    free: Array
    windowed: Array
    states: Array
    residual: Array


@dataclass(frozen=True, eq=False)
class Comparison:
    """A model held against measurements; ``to_json`` is what `signlin compare --json` prints.

    By name: ``channels``, ``inverse`` (at most one), ``residual_tests``, ``directions`` (means of what is missing by
    direction of motion), ``units``. ``where``: regions in which the error is concentrated, the worst first; ``horizon``
    s; ``traces`` and ``missing`` (what the equations lack) of each stretch without a gap. ``refit`` finds first rows.
    """

    model: Model
    channels: dict[str, ChannelScores]
    inverse: dict[str, InverseError]
    where: tuple[Region, ...]
    residual_tests: dict[str, ResidualTest]
    horizon: float
    samples: int
    sources: tuple[str, ...]
    notes: tuple[str, ...]
    directions: dict[str, dict[str, dict[str, float]]]
    units: dict[str, str]
    traces: tuple[Traces, ...] = field(repr=False)
    missing: tuple[Missing, ...] = field(repr=False)
    refit: Callable[[], FirstRows] = field(repr=False)

    @cached_property
    def first_rows(self) -> FirstRows | None:
        """The model as given and its base refitted, when first asked for; None where `without_rows` says why."""
        return self._first_rows[0]

    @property
    def without_rows(self) -> str:
        """Why there are no first rows; empty where there are."""
        return self._first_rows[1]

    @cached_property
    def _first_rows(self) -> tuple[FirstRows | None, str]:
        try:
            return self.refit(), ""
        except InputError as error:
            return None, f"the model was not refitted: {error}"

    def to_frame(self) -> Any:
        """Return RMS errors of each channel as a pandas DataFrame, beside its unit and noise: of the free run, and over
        the horizon on training and validation data, as given and refitted: the numbers of every diagnosis. Where the
        model could not be refitted, `without_rows`, ``windowed`` stands in their place.
        """
        columns: dict[str, Any] = {
            "channel": list(self.channels),
            "unit": [c.unit for c in self.channels.values()],
            "noise": [c.sigma for c in self.channels.values()],
            "free_run": [_rmse(c.free_run) for c in self.channels.values()],
        }
        rows = self.first_rows
        if rows is None:
            return frame(columns | {"windowed": [_rmse(c.windowed) for c in self.channels.values()]}, index="channel")
        for name, row in (("given", rows.given), ("refitted", rows.refitted)):
            for data, scores in (("training", row.estimation), ("validation", row.validation)):
                columns[f"{data}_{name}"] = [_rmse(scores.channels.get(c)) for c in self.channels]
        return frame(columns, index="channel")

    plot = drawn_by("signlin_ros.report.pictures", "measured_and_simulated")

    def to_json(self) -> dict[str, Any]:
        """Return the JSON object of schemas/compare.json."""
        return {
            "channels": {name: c.to_json() for name, c in self.channels.items()},
            "inverse": {name: i.to_json() for name, i in self.inverse.items()},
            "where": [region.to_json() for region in self.where],
            "residual_tests": {name: t.to_json() for name, t in self.residual_tests.items()},
            "missing": {m.name: {**m.to_json(), **self.directions.get(m.name, {})} for m in self.missing},
            "horizon": self.horizon,
            "model": self.model.source,
            "data": list(self.sources),
            "samples": self.samples,
            "notes": [*self._told(), *([self.without_rows] if self.without_rows else [])],
            "first_rows": self.first_rows.to_json() if self.first_rows else None,
        }

    def _told(self) -> list[str]:
        """Return the notes; what the model follows once its numbers are refitted is not put down to the record."""
        names = lost(self.channels)
        after = self.first_rows.refitted.validation.channels if names and self.first_rows else {}
        fits = {name: after[name].fit_percent for name in names if name in after}
        if not fits or set(unfollowed({n: after[n] for n in fits})) or len(fits) < len(names):
            return list(self.notes)
        told = joined([f"{name} ({fit:.0f} % of fit)" for name, fit in fits.items() if fit is not None])
        kept = [note for note in self.notes if note != follows_nothing(names)]
        return [*kept, f"as given the model does not follow, refitted it does: {told}; its numbers are off"]

    def _repr_html_(self) -> str:
        from signlin_ros.console import compare_text

        return f"<pre>{html.escape(compare_text(self.to_json()))}</pre>"


def lost(channels: Mapping[str, ChannelScores]) -> list[str]:
    """Return the channels that the model follows neither freely nor over windows."""
    ahead = unfollowed({name: c.windowed for name, c in channels.items() if c.windowed})
    return [name for name in ahead if (free := channels[name].free_run) is None or unfollowed({name: free})]


def _rmse(found: Score | None) -> float:
    """Return the RMS error of a score, in the channel's unit; nan where there is none."""
    return np.nan if found is None else found.rmse


__all__ = ["ChannelScores", "Comparison", "Traces", "lost"]
