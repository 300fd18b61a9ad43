"""What a diagnosis returns: plain, frozen, and as the JSON that the command line prints."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from signlin_ros.comparison.scores import Score
from signlin_ros.digits import with_error
from signlin_ros.errors import joined
from signlin_ros.lazy import drawn_by, frame
from signlin_ros.markup import html_table
from signlin_ros.model import Model
from signlin_ros.names import printed_name

if TYPE_CHECKING:
    from signlin_ros.diagnosis.findings import Findings
    from signlin_ros.diagnosis.rivals import Rival


def listed(names: Iterable[str]) -> str:
    """Return effects in words."""
    return joined([printed_name(n) for n in names])


def _json(value: Any) -> Any:
    """Return a value as JSON holds it: results as they tell themselves, what is not finite as None."""
    if hasattr(value, "to_json"):
        return value.to_json()
    if isinstance(value, Mapping):
        return {name: _json(one) for name, one in value.items()}
    if isinstance(value, tuple):
        return [_json(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@dataclass(frozen=True)
class ParameterEstimate:
    """A parameter: value, standard error (None: not known), unit; ``note`` says what is odd about it, if anything."""

    value: float
    std: float | None
    unit: str
    note: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return the value, standard error and unit as ``schemas/diagnose.json`` has them."""
        found: dict[str, Any] = {"value": self.value, "std": _json(self.std), "unit": self.unit}
        return {**found, "note": self.note} if self.note else found

    def __str__(self) -> str:
        text = " ± ".join(part for part in with_error(self.value, self.std) if part)
        return f"{text} {self.unit}".rstrip() if self.unit != "-" else text


@dataclass(frozen=True)
class Scores:
    """Scores by channel, over windows of the horizon."""

    channels: Mapping[str, Score]

    def to_json(self) -> dict[str, Any]:
        """Return the scores by channel as ``schemas/diagnose.json`` has them; ``score``: that they are of windows."""
        return {**{name: _json(s.to_json()) for name, s in self.channels.items()}, "score": "windowed"}

    @property
    def over_noise(self) -> float:
        """Largest error over the noise of all channels."""
        return max((s.rmse_over_noise or 0.0 for s in self.channels.values()), default=0.0)


@dataclass(frozen=True)
class RankingEntry:
    """One effect in the ranking: confirmed, ambiguous, not_excited, rejected or not_applicable; ``why``. ``force``:
    what it would leave of it, in per cent of the effort, where only the equation-error estimate tried it.
    """

    effect: str
    status: str
    parameters: Mapping[str, ParameterEstimate] = field(default_factory=dict)
    validation: Scores | None = None
    indistinguishable_from: tuple[str, ...] = ()
    why: str = ""
    force: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Return one entry of ``ranking``."""
        found = {name: _json(value) for name, value in vars(self).items() if name != "force"}
        return found | ({} if self.force is None else {"missing_force_percent": self.force})

    def _repr_html_(self) -> str:
        values = ", ".join(f"{name} = {estimate}" for name, estimate in self.parameters.items())
        return html_table(["effect", "status", "parameters", "why"], [[self.effect, self.status, values, self.why]])


@dataclass(frozen=True)
class LadderRow:
    """One step of the ladder; ``force``: what is left of it on validation data, ``force_noise``: what the sensors'
    noise makes of one, both in per cent of the effort (RMS); None where forces do not tell.
    """

    effects: tuple[str, ...]
    estimation: Scores
    validation: Scores
    force: float | None = None
    force_noise: float | None = None

    @property
    def force_over_noise(self) -> float | None:
        """What is left of the force over what the sensors' noise makes of it."""
        return self.force / self.force_noise if self.force is not None and self.force_noise else None

    def to_json(self) -> dict[str, Any]:
        """Return one entry of ``ladder``."""
        both = {"validation": self.validation.to_json(), "estimation": self.estimation.to_json()}
        force = {"missing_force_percent": self.force, "missing_force_over_noise": self.force_over_noise}
        return {"effects": list(self.effects), **both, **_json(force)}


@dataclass(frozen=True)
class FirstRows:
    """Rows of the model as in its file, and with its base refitted; ``horizon``: s over which motion is predicted."""

    given: LadderRow
    refitted: LadderRow
    horizon: float

    def to_json(self) -> dict[str, Any]:
        """Return the object ``first_rows`` of `signlin compare --json`."""
        return {name: _json(value) for name, value in vars(self).items()}


@dataclass(frozen=True)
class Diagnosis:
    """What a model lacks: the ``verdict`` (adequate, missing or unexplained) and its ``sentence``, estimates of the
    ``base`` and of the proposal (``parameters``, ``model``), ``range`` that the records visited, ``noise`` by channel,
    what ``experiments`` would decide, the model as ``given``, ``horizon`` in s of its motion, ``findings`` to picture;
    ``rivals`` that the records do not exclude, and the model file ``given_model`` that they add to.
    """

    verdict: str
    sentence: str
    base: Mapping[str, ParameterEstimate]
    parameters: Mapping[str, ParameterEstimate]
    ranking: tuple[RankingEntry, ...]
    ladder: tuple[LadderRow, ...]
    model: Model
    range: Mapping[str, tuple[float, float]]
    noise: Mapping[str, float]
    experiments: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    yaml: str = ""
    given: LadderRow | None = None
    horizon: float = 0.0
    findings: Findings | None = field(default=None, repr=False, compare=False)
    rivals: tuple[Rival, ...] = field(default=(), repr=False)
    given_model: str = field(default="", repr=False)

    @property
    def missing(self) -> tuple[RankingEntry, ...]:
        """The effects that the proposal adds."""
        return tuple(e for e in self.ranking if e.effect in self.ladder[-1].effects)

    def to_frame(self) -> Any:
        """Return the ranking as a pandas DataFrame: status, reason and ties of each effect."""
        columns = ("effect", "status", "why", "indistinguishable_from")
        return frame({name: [getattr(e, name) for e in self.ranking] for name in columns}, index="effect")

    plot = drawn_by("signlin_ros.report.diagnosis_pictures", "ladder")

    def to_json(self) -> dict[str, Any]:
        """Return the object of ``signlin diagnose --json``."""
        told = {name: _json(value) for name, value in vars(self).items() if name not in ("model", "yaml", "findings")}
        base = {"parameters": told["base"], "validation": self.ladder[0].validation.to_json()}
        return {**told, "base": base, "model": self.yaml}

    def _repr_html_(self) -> str:
        from signlin_ros.console import ERRORS, ladder_rows

        shown = [e for e in self.ranking if e.status in ("confirmed", "ambiguous", "not_excited")]
        table = html_table(["effect", "status", "why"], [[e.effect, e.status, e.why] for e in shown]) if shown else ""
        errors = html_table(ERRORS, ladder_rows(self.to_json()), f"Error over the next {self.horizon:.3g} s (RMS)")
        return f"<p><b>{html.escape(self.verdict)}</b>: {html.escape(self.sentence)}</p>{errors}{table}"


__all__ = ["Diagnosis", "FirstRows", "LadderRow", "ParameterEstimate", "RankingEntry", "Scores", "listed"]
