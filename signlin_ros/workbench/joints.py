"""What the page shows of Compare, Diagnose, Add and Use where the model is an arm. No numerics."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

from signlin_ros.names import printed_name
from signlin_ros.workbench import commands
from signlin_ros.workbench.questions import described, question, result
from signlin_ros.workbench.stages import block, checked_first

if TYPE_CHECKING:
    from signlin_ros.workbench.session import Session

ARM = "arm"
"""The plant of a model of several joints."""


def is_arm(s: Session) -> bool:
    """Tell whether the chosen model is that of an arm."""
    found = described(s)
    return found is not None and found["plant"] == ARM


def compare(s: Session) -> dict[str, Any]:
    """Return the stage Compare of an arm as JSON: a table of joints."""
    return _shown(s, "compare", "Each joint's effort: what the URDF, friction and the model leave of it.", _compared)


def diagnose(s: Session) -> dict[str, Any]:
    """Return the stage Diagnose of an arm as JSON: a sentence for each joint, and one for the robot."""
    return _shown(s, "diagnose", "What is missing, and in which joint?", _diagnosed)


def _shown(s: Session, verb: str, before: str, said: Any) -> dict[str, Any]:
    why = checked_first(s)
    if why:
        return block(verb, why, False, "")
    asked = question(s, verb)
    found, command = result(s, verb, asked), commands.command({"verb": verb, **asked})
    if found is None:
        return block(verb, "", False, before, command)
    return block(verb, "", True, said(found["json"]), command, result=found)


def _compared(content: dict[str, Any]) -> str:
    shares = {n: own["model"] / own["effort"] for n, own in content["joints"].items() if own["model"] and own["effort"]}
    band = f"below {content['band_hz']:g} Hz, on data that no fit saw"
    if not shares:
        return f"No joint moves enough to tell anything, {band}."
    worst = max(shares, key=lambda name: shares[name])
    return f"The model leaves at most {100 * shares[worst]:.2g} % of a joint's effort ({worst}), {band}."


def _diagnosed(content: dict[str, Any]) -> str:
    names = [printed_name(entry["effect"]) for entry in content["ranking"]]
    names += [f"a coupling of {' and '.join(pair)}" for pair in content["found_couplings"]]
    named = f": {', '.join(names)}" if names else ""
    return f"{content['verdict'].capitalize()}{named}."


def add(s: Session) -> dict[str, Any]:
    """Return that effects are added to an arm in a terminal."""
    return block("add", f"In a terminal: {_refine(s)}", False, "")


def use(s: Session) -> dict[str, Any]:
    """Return that an arm's model is its file, and how it is exported."""
    model = s.project.path(s.project.choices["model"])
    return block("use", f"In a terminal: signlin export {shlex.quote(model)} --to mjcf -o arm.xml", False, "")


def _refine(s: Session) -> str:
    asked = question(s, "diagnose")
    command = commands.command({"verb": "diagnose", **asked, "output": "NEW.yaml"})
    return command.replace("signlin diagnose", "signlin refine", 1)


__all__ = ["add", "compare", "diagnose", "is_arm", "use"]
