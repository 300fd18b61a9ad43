"""What the worker does for the next record: limits as the records visited them, the plan, its curves, its rivals.

A stored diagnosis and a file of rivals hold models as YAML, and come from whoever sent the folder: each is looked at
(`uploaded`) before anything reads it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from signlin_ros.errors import InputError
from signlin_ros.model import Model
from signlin_ros.records import ModelData
from signlin_ros.workbench import arrays
from signlin_ros.workbench.looking import points, span
from signlin_ros.workbench.uploaded import read_text

Args = Mapping[str, Any]
Say = Callable[[dict[str, Any]], None]
Array = NDArray[np.float64]
NOISE_BAND = 2.0
"""Standard deviations of the noise that are drawn about what a rival would show."""
MAX_RIVALS_BYTES = 8 << 20
"""Bytes of a file of rivals."""
OLDER = "the diagnosis was kept by another version: diagnose again"


# -------------------------------------------------------------------- limits


def asked_limits(model: Model, records: Sequence[ModelData]) -> list[dict[str, Any]]:
    """Return what a plan may be limited in: ``name``, ``doc``, ``unit``, and ``value``, what the records visited; None
    where no column tells. Nothing for a plant whose motion is imposed: no command is designed for it.
    """
    plant = model.plant
    if plant.motion_is_imposed():
        return []
    name, units = model.inputs[0], {**model.units, **records[0].units}
    largest = max(float(np.nanmax(np.abs(r.u[:, 0]))) for r in records)
    rows: list[tuple[str, str, str, float | None]] = [(name, "largest", units[name], largest)]
    rows.append((plant.velocity, "largest", units[plant.velocity], _largest(records, plant.velocity)))
    rows.append((plant.position, "farthest from its start", units[plant.position], _travel(records, plant.position)))
    rows.append(("slew", f"of the {name}", f"{units[name]}/s", None))
    return [{"name": n, "doc": doc, "unit": unit, "value": _short(value)} for n, doc, unit, value in rows]


def _largest(records: Sequence[ModelData], name: str) -> float | None:
    found = [float(np.nanmax(np.abs(r.measured[name]))) for r in records if _measures(r, name)]
    return max(found, default=None)


def _travel(records: Sequence[ModelData], name: str) -> float | None:
    found = [float(np.nanmax(y) - np.nanmin(y)) for r in records if _measures(r, name) for y in [r.measured[name]]]
    return max(found, default=None)


def _measures(record: ModelData, name: str) -> bool:
    return name in record.measured and bool(np.isfinite(record.measured[name]).any())


def _short(value: float | None) -> float | None:
    return None if value is None or not value > 0.0 else float(f"{value:.3g}")


# -------------------------------------------------------------------- what is not ours


def trusted(diagnosis: Any, folder: Path) -> dict[str, Any]:
    """Return the JSON of a diagnosis, every model in it looked at; ``folder``: where their own effects stand.

    Raises `CodeError` for code that was not agreed to, `InputError` for what is no diagnosis of this version.
    """
    try:
        rivals = [{**one, "model": _looked_at(one["model"], folder)} for one in diagnosis["rivals"]]
        return {**diagnosis, "given_model": _looked_at(diagnosis["given_model"], folder), "rivals": rivals}
    except (KeyError, TypeError) as error:
        raise InputError(OLDER) from error


def _looked_at(text: Any, folder: Path, dropped: bool = False) -> str:
    return read_text(str(text), "the model of a rival", folder, dropped=dropped).to_yaml()


def rivals_of(path: str, folder: Path, *, dropped: bool = False) -> list[Any]:
    """Return the rivals of a plan's file as `diagnose` takes them, every model in it looked at before it is read.

    ``dropped``: it came through the browser and may name no code at all. Raises `CodeError` for code that was not
    agreed to, `InputError` for what is no such file.
    """
    from signlin_ros.diagnosis.discrimination import PlannedRival

    file = Path(path)
    try:
        if file.stat().st_size > MAX_RIVALS_BYTES:
            raise InputError(f"{file.name}: {file.stat().st_size} bytes; allowed for rivals: {MAX_RIVALS_BYTES}")
        told = json.loads(file.read_text(encoding="utf-8"))["rivals"]
        texts = [one.get("starts") or [one["model"]] for one in told]
        looked = [[_looked_at(text, folder, dropped) for text in every] for every in texts]
        found = [PlannedRival.of_json({**one, "starts": own}) for one, own in zip(told, looked, strict=True)]
    except InputError:
        raise  # it says what is wrong by itself
    except OSError as error:
        raise InputError(f"{file.name}: cannot be read: {error.strerror}; take the plan back, or plan again") from error
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise InputError(f"{file.name}: is no file of rivals; the plan of the next record writes one") from error
    if not found:
        raise InputError(f"{file.name}: holds no rivals")
    return found


# -------------------------------------------------------------------- the plan


def planned(args: Args, say: Say, sides: Callable[[Args], Any]) -> dict[str, Any]:
    """Plan the next record for ``args["diagnosis"]``, keep its curves in ``args["store"]`` (npz); return what
    `signlin experiment --json` prints, the files to take away, and what the pictures are of.

    ``sides``: what returns model and records, see `calls`. ``args``: ``limits`` by name, ``between``, ``duration`` and
    ``dt`` in s (None: as the records are), ``spare``.
    """
    from signlin_ros.experiment.verbs import experiment

    say({"what": "planning: reading the records", "share": 0.01})
    model, first, second, _ = sides(args)
    content = trusted(args["diagnosis"], model.folder)
    plan = experiment(
        content,
        [*first, *(second or ())],
        {name: float(value) for name, value in args["limits"].items()},
        between=tuple(args["between"]),
        duration=args["duration"],
        dt=args["dt"],
        spare=float(args["spare"]),
        progress=lambda what, share: say({"what": f"planning: {what}", "share": share}),
    )
    shown = plan.preview or ()
    held = {f"{k}/{name}": getattr(one, name) for k, one in enumerate(shown) for name in _KEPT}
    np.savez(args["store"], t=plan.t, u=plan.u, **held)
    return {
        "json": plan.to_json(),
        "csv": plan.to_csv(),
        "rivals": plan.to_rivals(),
        "trajectory": plan.to_trajectory("joint") if plan.reference else "",
        "previews": [_pictured(one) for one in shown],
    }


def _pictured(one: Any) -> dict[str, Any]:
    return {"rivals": list(one.rivals), "channels": dict(zip(one.channels, one.units, strict=True))}


_KEPT = ("t", "true", "other", "noise", "distance")


def plan_curves(args: Args, say: Say) -> dict[str, Any]:
    """Return the command over time, and what two rivals would show, ``args["way"]``: which is the true one."""
    held, way = np.load(args["store"]), int(args.get("way") or 0)
    t, plots = held["t"], list[dict[str, Any]]()

    def put(name: str, unit: str, at: Array, curves: dict[str, Array]) -> None:
        plots.append({"name": name, "unit": unit, **arrays.picture(at, curves, span(args), points(args))})

    put(args["input"], args["unit"], t, {"command": held["u"]})
    if f"{way}/t" in held:
        at, true, other, noise, distance = (held[f"{way}/{name}"] for name in _KEPT)
        for j, (name, unit) in enumerate(args["channels"].items()):
            band = NOISE_BAND * noise[j]
            low, high = true[:, j] - band, true[:, j] + band
            put(name, unit, at, {"low": low, "high": high, "true": true[:, j], "other": other[:, j]})
        put("distance", "", at, {"distance": distance})
    return {"plots": plots, "span": [float(t[0]), float(t[-1])]}


__all__ = ["asked_limits", "plan_curves", "planned", "rivals_of", "trusted"]
