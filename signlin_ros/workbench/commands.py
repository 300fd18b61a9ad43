"""The command line that does the same as a click, and the script of all that was done.

A step is ``{"verb": ..., "model": ..., "data": [...], ...}`` with paths as the user would write them.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import Any

Step = Mapping[str, Any]
COMMAND_VERBS = ("check", "compare", "diagnose", "add", "experiment")
SCRIPT_HEAD = """\
#!/bin/sh
# What was done in the workbench, as commands; the numbers are the same. Results go to the folder {replay}.
set -eu
cd {folder}
mkdir -p {replay}
"""


def command(step: Step) -> str:
    """Return the command line of a step; empty for what only the page can do."""
    return shlex.join(_words(step)) if step["verb"] in COMMAND_VERBS else ""


def _words(step: Step) -> list[str]:
    words = ["signlin", step["verb"], *([step["effect"]] if step.get("effect") else []), step["model"], *step["data"]]
    for file in step.get("validation") or ():
        words += ["--validation", file]
    for name, column in (step.get("signals") or {}).items():
        words += ["--signal", f"{name}={column}"]
    for cure in step.get("cures") or ():
        words += ["--cure", cure]
    words += _planned(step) if step["verb"] == "experiment" else []
    if step.get("rivals"):
        words += ["--rivals", step["rivals"]]
    if step.get("over"):
        words += ["--over", step["over"]]
    if step.get("output"):
        words += ["-o", step["output"]]
    return words


def _planned(step: Step) -> list[str]:
    """Return the options of ``experiment``."""
    words = [part for name, value in step["limits"].items() for part in ("--limit", f"{name}={value:g}")]
    words += ["--between", ",".join(step["between"])] if step["between"] else []
    for option in ("duration", "dt"):
        words += [f"--{option}", f"{step[option]:g}"] if step[option] else []
    return [*words, "--spare", f"{step['spare']:g}"]


def script(folder: Path, replay: str, steps: Iterable[Step], texts: Mapping[str, str]) -> str:
    """Return a shell script that does the steps anew, from ``folder``; ``texts``: models set by hand, by path.

    Models that a step writes are written to the folder ``replay`` and read from there by the steps after it.
    """
    made: dict[str, str] = {}
    diagnosis = ""
    lines = [SCRIPT_HEAD.format(folder=shlex.quote(str(folder.resolve())), replay=shlex.quote(replay))]
    for number, step in enumerate(steps, 1):
        if step["verb"] == "set":
            target = made[step["output"]] = f"{replay}/{Path(step['output']).name}"
            text = texts[step["output"]].rstrip()
            end = next(word for k in count() if (word := f"END_OF_MODEL{k or ''}") not in text)
            lines.append(f"cat > {shlex.quote(target)} <<'{end}'\n{text}\n{end}")
            continue
        moved = {**step, "model": made.get(step["model"], step["model"])}
        if step["verb"] == "experiment":
            moved |= {"model": diagnosis, "data": [], "validation": []}
        if step.get("output"):
            moved["output"] = made[step["output"]] = f"{replay}/{Path(step['output']).name}"
        answer = f"{replay}/{number}_{step['verb']}.json"
        diagnosis = answer if step["verb"] == "diagnose" else diagnosis
        lines.append(f"{command(moved)} --json > {shlex.quote(answer)}")
    return "\n".join(lines) + "\n"


def launch_line(model: str) -> str:
    """Return the command that starts the linearizer with a model."""
    return f"ros2 run signlin_ros linearizer --ros-args --params-file {shlex.quote(model)}"


def distinct(steps: Sequence[Step]) -> list[Step]:
    """Return the steps without those that were only done again."""
    return [step for k, step in enumerate(steps) if step not in steps[:k]]


__all__ = ["Step", "command", "distinct", "launch_line", "script"]
