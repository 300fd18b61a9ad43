"""A model as a file for another tool, run there on a record: what the page asks of `signlin_ros.export`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from signlin_ros.workbench.uploaded import opened


def use(args: Mapping[str, Any], say: Callable[[dict[str, Any]], None]) -> dict[str, Any]:
    """Write ``args["output"]`` for ``args["target"]`` and run it there on the first record; as `signlin export`."""
    from signlin_ros.diagnosis import load_records
    from signlin_ros.export import export
    from signlin_ros.guard import check_records

    model = opened(args["model"])
    say({"what": f"writing for {args['target']} and running it there", "share": 0.2})
    model, records = load_records(model, list(args["data"]), args.get("signals") or {})
    found, _ = check_records(model, list(records), tuple(args.get("cures") or ()), validated=False)
    return {"json": export(model, str(args["target"]), str(args["output"]), found[0]).content()}


__all__ = ["use"]
