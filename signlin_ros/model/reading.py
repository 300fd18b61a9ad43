"""What stands below ``ros__parameters`` as the fields of a model."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from signlin_ros.effects import load_effect_file
from signlin_ros.errors import ModelError, choices, suggest
from signlin_ros.model.options import MODEL_OPTIONS, NODE_KEYS, RESERVED_KEYS
from signlin_ros.model.uses import effects_of
from signlin_ros.par import check_values
from signlin_ros.plants import find_plant


def fields_of(mapping: Mapping[str, Any], source: str, folder: Path) -> dict[str, Any]:
    """Return the fields of a model, each checked by itself; raise `ModelError` naming the key."""
    known = ("plant", "parameters", "effects", *MODEL_OPTIONS, *NODE_KEYS, *RESERVED_KEYS)
    for key in mapping:
        if key not in known:
            raise ModelError(f"{key}: unknown key; known: {choices(known)}{suggest(str(key), known)}")
    if "plant" not in mapping:
        raise ModelError("plant: missing")
    plant = find_plant(mapping["plant"], "plant")
    options = {key: check(mapping[key], key) for key, check in MODEL_OPTIONS.items() if key in mapping}
    if options.get("linearization") == "per_joint":
        raise ModelError(
            f"linearization: per_joint is for an arm; allowed for {plant.name}: optimal, termwise, jacobian"
        )
    for name in options.get("effect_files", ()):
        load_effect_file(folder / name)
    table = mapping.get("parameters", {})
    if not isinstance(table, Mapping):
        raise ModelError(f"parameters: found {table!r}; allowed: a mapping of {choices(plant.pars())}")
    values = check_values(plant.pars(), table, "parameters")
    return {
        "plant": plant,
        "parameters": values,
        "effects": effects_of(mapping.get("effects"), plant, values),
        "node_options": {key: mapping[key] for key in mapping if key in (*NODE_KEYS, *RESERVED_KEYS)},
        "source": source,
        "folder": folder,
        "linearization": plant.linearization,
        **options,
    }


__all__ = ["fields_of"]
