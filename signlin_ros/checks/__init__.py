"""What may be wrong with a record, looked for before anything is concluded from it.

    records, findings = check(model, records)                        harmless cures are applied
    records, findings = check(model, records, ["speed_in_rpm"])      and this one too

A check is one file here and a line in `registry`: what it looks for, a test and how often that is wrong, a sentence,
the cure.
"""

from __future__ import annotations

from signlin_ros.lazy import exports

_EXPORTS = {
    "CHECKS": "registry",
    "Finding": "finding",
    "check": "run",
    "require_sound": "run",
    "to_json": "finding",
}

__getattr__, __dir__ = exports(__name__, _EXPORTS)
