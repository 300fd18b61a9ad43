"""What came through the browser is looked at before anything reads it: a model file may name no code, and no bomb."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from signlin_ros.errors import ModelError

LARGEST = 1 << 20
"""Bytes of a model file."""
MOST, DEEPEST = 20_000, 40
"""Nodes of a model file, and levels."""


def check_model(path: Path) -> None:
    """Refuse an uploaded model file that is too large, uses anchors, or names effect files; raises `ModelError`."""
    size = path.stat().st_size
    if size > LARGEST:
        raise ModelError(f"{path.name}: {size} bytes; allowed for a model file: {LARGEST}")
    try:
        text = path.read_text(encoding="utf-8")
        _check_shape(text, path.name)
        tree = yaml.safe_load(text)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ModelError(f"{path.name}: not a YAML file: {' '.join(str(error).split())[:300]}") from error
    files = list(_effect_files(tree))
    if any(files):
        raise ModelError(
            f"{path.name}: effect_files {files[0]!r} is code, and code is not taken from the browser; start"
            " `signlin workbench MODEL` with the path of the model file instead"
        )


def _check_shape(text: str, name: str) -> None:
    """Refuse anchors and aliases, which can stand for more nodes than there are atoms, and endless nesting."""
    depth = 0
    for count, event in enumerate(yaml.parse(text, Loader=yaml.SafeLoader)):
        if isinstance(event, yaml.events.AliasEvent) or getattr(event, "anchor", None):
            raise ModelError(f"{name}: anchors and aliases are not taken from the browser; write the values out")
        depth += isinstance(event, yaml.events.CollectionStartEvent)
        depth -= isinstance(event, yaml.events.CollectionEndEvent)
        if depth > DEEPEST or count > MOST:
            raise ModelError(f"{name}: more than {MOST} entries or {DEEPEST} levels are not a model file")


def _effect_files(tree: Any) -> Any:
    """Yield what stands below every key ``effect_files`` of a tree."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            if key == "effect_files":
                yield value
            yield from _effect_files(value)
    elif isinstance(tree, list):
        for value in tree:
            yield from _effect_files(value)


__all__ = ["check_model"]
