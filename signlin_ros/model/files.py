"""Model files: which ship with the package, where one is found, and YAML as ROS 2 reads and writes it."""

from __future__ import annotations

import os
import re
import sysconfig
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from signlin_ros.errors import ModelError, choices, suggest

MODEL_SUFFIXES = (".yaml", ".yml")
"""Suffixes of model files."""


def shipped_models() -> dict[str, Path]:
    """Return the model files that come with the package, by name."""
    here = Path(__file__).parents[1]
    prefixes = (*here.parents, Path(sysconfig.get_path("data")))  # of a ROS 2 workspace, of a virtual environment
    places = (here.parent / "config", *(prefix / "share" / "signlin_ros" / "config" for prefix in prefixes))
    for place in places:
        files = {f.stem: f for f in sorted(place.glob("*.yaml"))}
        if "dc_motor" in files:
            return files
    return {}


def find_model_file(path: str | Path) -> Path:
    """Return the file for a path or a shipped name; raise `ModelError` naming the nearest shipped one."""
    file = Path(path)
    if file.is_file():
        return file
    shipped = shipped_models()
    if str(path) in shipped:
        return shipped[str(path)]
    if file.is_dir():
        raise ModelError(f"{path}: is a folder, not a model file")
    raise ModelError(f"{path}: no such model file; shipped models: {choices(shipped)}{suggest(str(path), shipped)}")


def relative(file: Path, folder: Path) -> str:
    """Return how a file is called from a folder; links among the folders on the way do not lead astray."""
    return os.path.relpath(file.parent.resolve() / file.name, folder.resolve())


def parameters_of(content: Any, file: str) -> Mapping[str, Any]:
    """Return the mapping below ``ros__parameters`` of the one node, or wildcard, that the file speaks of."""
    if not isinstance(content, Mapping) or not content:
        raise ModelError(f"{file}: empty, or not a ROS 2 parameter file (/**: ros__parameters: ...)")
    blocks = [v["ros__parameters"] for v in content.values() if isinstance(v, Mapping) and "ros__parameters" in v]
    blocks = [block for block in blocks if isinstance(block, Mapping) and "plant" in block] or blocks
    if len(blocks) != 1 or not isinstance(blocks[0], Mapping):
        found = choices(str(k) for k in content)
        raise ModelError(
            f"{file}: found top-level key(s) {found}; allowed: one node or /** with ros__parameters below it"
        )
    return blocks[0]


class Loader(yaml.SafeLoader):
    """Reads ``1e5`` and ``1.0e5`` as numbers, as ROS 2 does (YAML 1.1 takes them for text), and no key twice."""

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        """Return a mapping as it stands; raise `ModelError` for a key that stands in it twice."""
        node = super().compose_mapping_node(anchor)
        lines: dict[str, int] = {}
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            line = key.start_mark.line + 1
            if key.value in lines:
                raise ModelError(f"{key.value}: given twice, in line {lines[key.value]} and in line {line}")
            lines[key.value] = line
        return node


Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"), list("-+.0123456789")
)


class Dumper(yaml.SafeDumper):
    """Floats that YAML 1.1 reads back as floats (``1.0e-06``), and short mappings on one line."""


def _represent_float(dumper: yaml.SafeDumper, value: float) -> yaml.Node:
    text = repr(float(value))
    if "e" in text and "." not in text:
        text = text.replace("e", ".0e")
    return dumper.represent_scalar("tag:yaml.org,2002:float", text)


Dumper.add_representer(float, _represent_float)


__all__ = ["MODEL_SUFFIXES", "Dumper", "Loader", "find_model_file", "parameters_of", "relative", "shipped_models"]
