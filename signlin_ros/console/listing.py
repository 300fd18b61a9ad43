"""The catalogue of effects and plants as text."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from signlin_ros.console.tables import table


def effects_text(content: dict[str, Any]) -> str:
    """Return the catalogue of effects, one line each."""
    entries = content["effects"].values()
    rows = [[e["name"], e["equation"]] for e in entries]
    return "\n".join(
        [
            "Force or torque on the moving mass, v its velocity, q its position; positive accelerates.",
            "Of a sensor: y is what it shows of the true value x of a channel, a state or an output.",
            "`signlin effects NAME` shows units, bounds, plants and the source.\n",
            table([["effect", "law"], *rows], indent=""),
        ]
    )


def plants_text(content: dict[str, Any]) -> str:
    """Return the catalogue of plants, one block each."""
    return "\n\n".join(_plant(entry) for entry in content["plants"].values())


def effect_text(content: dict[str, Any]) -> str:
    """Return one effect in full."""
    (entry,) = content["effects"].values()
    states = [[name, _unit(units)] for name, units in entry["states"].items()]
    facts = [["law", entry["equation"]], ["plants", ", ".join(entry["plants"]) or "(none)"]]
    facts += [["dissipative", "yes"]] if entry["dissipative"] else []
    facts += [["source", entry["source"]]] if entry["source"] else []
    facts += [["per channel", _CHANNELS.format(**entry)]] if entry["per_channel"] else []
    blocks = [f"{entry['name']}: {entry['summary']}", table(facts), _parameters(entry)]
    return "\n\n".join(blocks + (["own states\n" + table(states)] if states else []))


_CHANNELS = "given by the names of states and outputs: {name}: {{velocity: ...}}; those not named have the default"


def plant_text(content: dict[str, Any]) -> str:
    """Return one plant in full."""
    (entry,) = content["plants"].values()
    aliases = ", ".join(f"{alias} = {name}" for alias, name in entry["aliases"].items() if name)
    facts = [
        ["aliases", aliases],
        ["method", f"{entry['linearization']} unless the model file says otherwise"],
    ]
    facts += [["source", entry["source"]]] if entry["source"] else []
    return "\n\n".join([_plant(entry), table(facts), _parameters(entry), _wrapped("effects", entry["effects"])])


def _plant(entry: dict[str, Any]) -> str:
    rows = [["equation", entry["equation"]]]
    for kind in ("states", "inputs"):
        optional = [f"({name} [{unit}])" for name, unit in entry[f"optional_{kind}"].items()]
        rows.append([kind, ", ".join([f"{n} [{unit}]" for n, unit in entry[kind].items()] + optional)])
    rows.append(["outputs", ", ".join(f"{name} [{unit}]" for name, unit in entry["outputs"].items())])
    return f"{entry['name']}: {entry['summary']}\n{table(rows)}"


def _parameters(entry: dict[str, Any]) -> str:
    rows = [["", "unit", "allowed", "nominal", "default", ""]]
    for name, par in entry["parameters"].items():
        rows.append(
            [name, _unit(par["units"]), _allowed(par), _value(par["nominal"]), _value(par["default"]), par["doc"]]
        )
    return "parameters\n" + table(rows)


def _allowed(par: dict[str, Any]) -> str:
    if par["choices"]:
        return ", ".join(map(_value, par["choices"]))
    one = f"{'(' if par['low_excluded'] else '['}{par['low']:g}, {par['high']:g}]"
    many = f"as many as {par['along']}, each in" if par["along"] else "a list, each in"
    return f"{many} {one}" if par["list"] else one


def _value(value: Any) -> str:
    """Return a number, a word or a list of these as a model file has it; - for none."""
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    return "-" if value is None else value if isinstance(value, str) else f"{value:g}"


def _unit(units: dict[str, str]) -> str:
    return " or ".join(dict.fromkeys(units.values()))


def _wrapped(title: str, names: Sequence[str]) -> str:
    lines = [""]
    for name in names:
        if len(lines[-1]) + len(name) > 96:
            lines.append("")
        lines[-1] += f"{name}, "
    return title + "\n" + "\n".join(f"  {line.rstrip()}" for line in lines).rstrip(",")


__all__ = ["effect_text", "effects_text", "plant_text", "plants_text"]
