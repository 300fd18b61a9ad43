"""A model file is looked at before anything reads it, wherever it lies: no bomb, and no code that was not agreed to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from signlin_ros.errors import ModelError
from signlin_ros.model import Model
from signlin_ros.model.files import find_model_file
from signlin_ros.workbench import trust

MAX_MODEL_BYTES = 1 << 20
"""Bytes of a model file, and of a file of effects."""
MAX_MODEL_NODES, MAX_MODEL_DEPTH = 20_000, 40
"""Nodes of a model file, and levels."""


class CodeError(ModelError):
    """A model names code that was not agreed to; ``files``: path, digest and text of each."""

    def __init__(self, model: str, files: list[dict[str, str]]) -> None:
        names = ", ".join(Path(one["file"]).name for one in files)
        super().__init__(f"{model}: names code of its own, {names}: look at it in Record, and run it if it is yours")
        self.files = files


def opened(path: str, *, dropped: bool = False) -> Model:
    """Return the model of a file or of a shipped name.

    ``dropped``: it came through the browser and may name no code at all. Raises `CodeError` for code that was not
    agreed to, `ModelError` for all else that is wrong.
    """
    file = find_model_file(path)
    _agreed(file.name, file.parent, _checked(file), dropped)
    return Model.load(path)


def read_text(text: str, name: str, folder: Path, *, dropped: bool = False) -> Model:
    """Return the model of a text, its effect files by their whole paths; ``folder``: what they are relative to.

    Raises as `opened`; ``name``: what the text is called in errors.
    """
    if len(text) > MAX_MODEL_BYTES:
        raise ModelError(f"{name}: {len(text)} characters; allowed for a model: {MAX_MODEL_BYTES}")
    _agreed(name, folder, _named_files(text, name), dropped)
    model = Model.from_yaml(text, name, folder)
    return replace(model, effect_files=tuple(str((folder / one).resolve()) for one in model.effect_files))


def _agreed(name: str, folder: Path, files: Sequence[str], dropped: bool) -> None:
    """Raise `CodeError` where files of code were not agreed to, `ModelError` for any that was dropped."""
    if files and dropped:
        raise ModelError(
            f"{name}: effect_files {files[0][:80]!r} is code, and code is not taken from the browser; start"
            " `signlin workbench MODEL` with the path of the model file instead"
        )
    strange = [one for one in map(_shown, (folder / file for file in files)) if one]
    if strange:
        raise CodeError(name, strange)


def _shown(file: Path) -> dict[str, str] | None:
    """Return a file of code as it is to be looked at; None where it was agreed to, or is none."""
    if not file.is_file():
        return None
    if file.stat().st_size > MAX_MODEL_BYTES:
        raise ModelError(f"{file.name}: {file.stat().st_size} bytes; allowed for a file of effects: {MAX_MODEL_BYTES}")
    content = file.read_bytes()
    found = trust.digest(content)
    if found in trust.agreed():
        return None
    return {"file": str(file.resolve()), "digest": found, "text": content.decode(errors="replace")}


def _checked(path: Path) -> list[str]:
    """Return the files of code that a model file names; raise `ModelError` where it is too large or uses anchors."""
    size = path.stat().st_size
    if size > MAX_MODEL_BYTES:
        raise ModelError(f"{path.name}: {size} bytes; allowed for a model file: {MAX_MODEL_BYTES}")
    try:
        return _named_files(path.read_text(encoding="utf-8"), path.name)
    except UnicodeDecodeError as error:
        raise ModelError(f"{path.name}: not a YAML file: {error}") from error


def _named_files(text: str, name: str) -> list[str]:
    """Return the files of code that the text of a model names; raise `ModelError` where it uses anchors."""
    try:
        _check_shape(text, name)
        tree = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ModelError(f"{name}: not a YAML file: {' '.join(str(error).split())[:200]}") from error
    return list(dict.fromkeys(_effect_files(tree)))


def _check_shape(text: str, name: str) -> None:
    """Refuse anchors and aliases, which can stand for more nodes than there are atoms, and endless nesting."""
    depth = 0
    for count, event in enumerate(yaml.parse(text, Loader=yaml.SafeLoader)):
        if isinstance(event, yaml.events.AliasEvent) or getattr(event, "anchor", None):
            raise ModelError(f"{name}: anchors and aliases are not taken by the page; write the values out")
        depth += isinstance(event, yaml.events.CollectionStartEvent)
        depth -= isinstance(event, yaml.events.CollectionEndEvent)
        if depth > MAX_MODEL_DEPTH or count > MAX_MODEL_NODES:
            raise ModelError(
                f"{name}: more than {MAX_MODEL_NODES} entries or {MAX_MODEL_DEPTH} levels are not a model file"
            )


def _effect_files(tree: Any) -> Iterator[str]:
    """Yield the names that stand below every key ``effect_files`` of a tree."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            if key == "effect_files" and value:
                yield from map(str, value if isinstance(value, list) else [value])
            yield from _effect_files(value)
    elif isinstance(tree, list):
        for value in tree:
            yield from _effect_files(value)


__all__ = ["CodeError", "opened", "read_text"]
