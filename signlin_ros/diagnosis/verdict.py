"""The verdict that follows from a selection: adequate, missing or unexplained, and every number that it rests on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from signlin_ros.diagnosis.equation_error.flexible import Curve
from signlin_ros.diagnosis.evidence import Evidence
from signlin_ros.diagnosis.output_error import FittedModel
from signlin_ros.diagnosis.selection import Selection
from signlin_ros.diagnosis.validation import ValidationTests


@dataclass(frozen=True, eq=False)
class Verdict:
    """What follows from a ``selection``: values only.

    - ``label``: adequate, missing or unexplained; ``reason``: see `reason_of`; ``refused``: why the records do not ask
      for what `add` was asked for.
    - Of the records: ``reversed``, the signal with whose sign reversed the model as given follows much better;
      ``lost``, channels that no model follows.
    - Of what the selected model leaves of validation data: ``percent`` of the effort as force (``imposed``: per cent of
      the spread of an imposed motion's force); ``flexible``, what a flexible curve makes of it; ``changing``, which
      force changes slowly along the records; ``loop``, the hysteresis that explains a part; ``alone``, that no other
      law takes it away.
    - Of its parameters and gain: ``far``, base parameters far from nominal and by how many tolerances;
      ``holds_a_part``, that these values hold a part of what is missing; ``worse``, what rises; ``beside_given``,
      standard errors of its gain beside the model as given.
    - Fits beside it: ``steps`` from the base to it, ``without`` each of its effects, and ``sampled``, with inputs
      sampled from what goes on in between, where that is surely better.
    """

    selection: Selection
    base: FittedModel
    label: str
    reason: str
    flexible: Curve
    steps: tuple[FittedModel, ...]
    without: Mapping[str, FittedModel] = field(default_factory=dict)
    refused: str = ""
    reversed: str = ""
    lost: tuple[str, ...] = ()
    far: Mapping[str, float] = field(default_factory=dict)
    percent: float | None = None
    imposed: float | None = None
    changing: str = ""
    loop: str = ""
    alone: bool = False
    worse: str = ""
    beside_given: float = 0.0
    sampled: FittedModel | None = None
    holds_a_part: bool = False

    @property
    def final(self) -> FittedModel:
        """The selected model."""
        return self.selection.chosen

    @property
    def names(self) -> tuple[str, ...]:
        """The effects that the model lacks."""
        return self.final.effects


def reason_of(tests: ValidationTests, conflict: str = "") -> str:
    """Return why the records are not explained, a key of `signlin_ros.diagnosis.wording.reasons.REASONS`; empty if they
    are. ``conflict``: why the two estimates differ. The first test that fails decides:

    | reason | what it means |
    |---|---|
    | reversed | with the sign of one signal reversed, the model as given follows much better |
    | conflict | motion and force ask for different effects |
    | lost | nothing is named, and none of the models that were fitted follows some channel |
    | worse | with the effects the error of a channel, or the missing force, surely rises |
    | given | the effects gain beside the refitted base, but not surely beside the model as given |
    | once | an effect remembers the way, and an imposed motion turns back once in a record at most |
    | noise | the base errs by no more than the sensors' noise, and the effects take nothing visible away |
    | far | a base parameter ends far from nominal: held there the effects are not confirmed (a nominal value that was
      fitted without them holds a part of them, where about noise is left), or it crosses with them |
    | structure | more than half of the force (RMS) is left |
    | loop | hysteresis is named, and more than a quarter of the force (RMS) is left |
    | elsewhere | validation data are followed far worse than those of the fit |
    | structure | what is left is no noise that was tested: `_reason_by_force`, `_reason_by_motion` |

    A servo that is followed to its sensors' noise is explained, whatever the last two say.
    """
    if tests.reversed:
        return "reversed"
    if conflict:
        return "conflict"
    if not tests.names and tests.unfollowed:
        return "lost"
    if tests.names and tests.worse():
        return "worse"
    if tests.names and tests.no_better:
        return "given"
    if tests.final.remembers and tests.dataset.turns_once:
        return "once"
    if tests.names and tests.of_noise:
        return "noise"
    far = tests.names and tests.far
    if far and (tests.overcompensates or not (tests.holds_a_part or tests.same_at_nominal())):
        return "far"
    if tests.leaves_most or tests.loop:
        return "structure" if tests.leaves_most else "loop"
    if tests.force_shows:
        return _reason_by_force(tests)
    if tests.dataset.plant.closed_loop and tests.evidence.near_noise(tests.final):
        return ""  # where a servo sticks, the steps of its encoder are no noise that could be tested
    return _reason_by_motion(tests)


def _reason_by_force(tests: ValidationTests) -> str:
    """Return the reason where the force residual is above its noise floor: its size and structure count.

    Without a named effect it must be white, however small; from `min_missing_share` on tested noise, or near the
    sensors', within theirs where samples are too few to test it. With one, no more than a quarter of the force may be
    left with structure in the motion, nor that part of the effort where the residual follows from the model's own
    motion; near the noise it must be white, or the steps of a sensor.
    """
    final, near = tests.final, tests.evidence.near_noise(tests.final)
    largest = max(tests.percent or 0.0, tests.unpredicted)
    large = not tests.names and largest > tests.criteria.missing_percent
    if large and tests.generalizes_badly:
        return "elsewhere"
    noise = (final.residual_is_noise and (not large or tests.follows)) or tests.near_white_noise
    seen = (large or tests.flexible.visible) and not noise
    more = tests.leaves_much_force or tests.leaves_more_of_motion or tests.changing or tests.has_idle_law()
    structured = not final.white and ((near and not tests.of_steps) or more or not tests.names)
    untested = tests.leaves_much_force and tests.leaves_much_motion and not final.residual_is_noise
    return "structure" if seen or structured or untested else ""


def _reason_by_motion(tests: ValidationTests) -> str:
    """Return the reason where no force residual is seen: the residual of the motion must be noise, or small: a law may
    leave no part of a channel's spread with structure that counts as missing; where a load floats, whose place nobody
    sees while the play is crossed, near the noise.
    """
    noise = tests.evidence.residual_is_white(tests.final) or tests.of_steps
    small = tests.unpredicted <= 100.0 * tests.criteria.max_rmse_left  # more is no noise of an input
    noise = noise and (bool(tests.names) or small)
    near = tests.evidence.near_any_noise(tests.final)
    if tests.names and not near and (noise or tests.percent is None):
        explained = tests.explains_all_force or not (tests.leaves_much_motion or tests.leaves_structured_channel)
        explained = explained or (tests.carries_over and not tests.generalizes_badly)
        return "" if explained else "elsewhere" if tests.generalizes_badly else "structure"
    follows = tests.final.floats and tests.evidence.near_noise(tests.final) and not tests.leaves_much_motion
    return "" if noise or tests.within_noise or tests.leaves_little or follows else "structure"


def verdict_of(evidence: Evidence, selection: Selection) -> Verdict:
    """Test a selected model on validation data, and return what follows."""
    tests = ValidationTests(evidence, selection.chosen)
    reason = reason_of(tests, selection.conflict)
    refused = evidence.output_error.refusal(evidence.base, selection.chosen) if selection.asked else ""
    named, open_reason = bool(selection.chosen.effects), reason
    if refused:  # what `add` was asked for is not named then: the label is that of the base model
        named, open_reason = False, reason_of(ValidationTests(evidence, evidence.base))
    without = {n: tests.without(n) for n in tests.names}
    steps, sampled = tests.steps(), tests.sampled()
    return Verdict(
        selection=selection,
        base=evidence.base,  # asked for after these fits, which may have led further down
        label="unexplained" if open_reason else "missing" if named else "adequate",
        reason=reason,
        steps=steps,
        without=without,
        refused=refused,
        reversed=tests.reversed,
        lost=tuple(tests.unfollowed) if reason == "lost" else (),
        far=tests.far,
        percent=tests.percent,
        imposed=tests.imposed,
        flexible=tests.flexible,
        changing=tests.changing,
        loop=tests.loop,
        alone=bool(tests.names) and not reason and tests.leaves_much_motion and tests.carries_over,
        worse=tests.worse() if reason == "worse" else "",
        beside_given=tests.beside_given,
        sampled=sampled,
        holds_a_part=bool(tests.far) and tests.holds_a_part,
    )


__all__ = ["Verdict", "reason_of", "verdict_of"]
