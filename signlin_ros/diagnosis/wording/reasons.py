"""Why records are not explained: what the verdict says of each reason."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Reason:
    """What follows "explains a part", whether nothing is confirmed, and why validation data do not tell of a
    proposal.
    """

    said: str = ""
    rejects: bool = False
    untold: str = ""


REASONS = {
    "reversed": Reason(rejects=True),
    "conflict": Reason(rejects=True),
    "lost": Reason(),
    "worse": Reason(
        " would lower an error, but that of {v.worse} rises on validation data: nothing is confirmed.",
        rejects=True,
        untold="an error on validation data rises with it",
    ),
    "given": Reason(
        ": beside the refitted model {falls}, but the error {changes} beside the model as given, which is too little: "
        "nothing is confirmed.",
        rejects=True,
        untold="it gains too little of validation data beside the model as given",
    ),
    "once": Reason(
        " ({falls}), but the motion turns back only once in a record: a force that remembers the way and one that "
        "changes with time look alike there.",
        untold="it remembers the way, and the motion turns back only once in a record",
    ),
    "noise": Reason(rejects=True, untold="what it takes away is less than the sensors' noise"),
    "far": Reason(" ({falls}), but only with base parameters that far from nominal.", rejects=True),
    "elsewhere": Reason(
        " ({falls}), but the model follows the data it was fitted to far better than the unseen ones{there}"
    ),
    "loop": Reason(" ({falls}): what is there is hysteresis{loops}.{rest}"),
    "structure": Reason(),
}
"""Why records are not explained: what `Verdict.reason` may be; `signlin_ros.diagnosis.verdict.reason_of` says when."""

__all__ = ["REASONS", "Reason"]
