"""A project is a folder: what was chosen, what was found, and every model version; the page is a view of it.

``.signlin/<id>/state.json`` holds the choices and what they were before (undo); ``results`` holds what was found, each
under a key made of the choices that led to it, so that going back shows the earlier result again. Files that were
dropped and models that were made stand beside them.
"""

from __future__ import annotations

import contextlib
import copy
import fcntl
import hashlib
import json
import os
import re
import secrets
import shutil
import time
import unicodedata
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from signlin_ros.errors import InputError
from signlin_ros.files import BAGS, PACKED, TABLES, TEXT, write_text
from signlin_ros.workbench import trust

STORE = ".signlin"
VERSION = 1
ANSWERS = 4
"""Version of what the worker answers: answers to another one are asked for anew."""
MODELS = (".yaml", ".yml")
RIVALS = ".rivals.json"
"""How the file of a plan's rivals ends."""
ROBOTS = (".urdf",)
DROPPED_SUFFIXES = (*TEXT, *TABLES, *BAGS, *PACKED)
"""Suffixes of what may be dropped; what this version's readers cannot read they refuse with the reason."""
MAX_NAME_LENGTH = 80
"""Characters of a file's name."""
UNDO = 100
"""So many steps can be taken back."""
EMPTY_PROJECT: dict[str, Any] = {"model": None, "records": [], "cures": [], "path": []}
MAX_LISTED_PROJECTS = 20
"""So many projects are listed."""
_ID = re.compile(r"[a-z0-9]{12}\Z")


def safe_name(name: str) -> str:
    """Return a file name that is nothing but a name: no path, not hidden, no control characters, not too long.

    Raises `InputError` for a kind of file that is neither a record nor a model.
    """
    last = re.split(r"[/\\]", unicodedata.normalize("NFC", name))[-1]
    plain = Path(re.sub(r"[^\w.+\-() ]", "_", last).strip(" .") or "file")
    suffix = plain.suffix.lower()
    if plain.name.lower().endswith(RIVALS):
        return _shortened(plain.name[: -len(RIVALS)]) + RIVALS
    if suffix not in (*MODELS, *ROBOTS, *DROPPED_SUFFIXES):
        shown = "".join(c if c.isprintable() else "?" for c in last)[:MAX_NAME_LENGTH]
        raise InputError(
            f"{shown!r} is no record and no model; allowed: {', '.join((*DROPPED_SUFFIXES, *MODELS, *ROBOTS))}"
        )
    return _shortened(plain.stem) + suffix


def _shortened(stem: str) -> str:
    return stem.lstrip("-.")[:MAX_NAME_LENGTH].strip() or "file"


def plan_of(choices: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the plan of the next record of some choices (see `plans`); None where there is none, or it is not one."""
    found: Any = choices.get("planned")
    try:
        own = [*found["files"].values(), *found["records"], *found["names"]]
        whole = "rivals" in found["files"] and isinstance(found["asked"], (dict, type(None))) and "model" in found
    except (TypeError, KeyError, AttributeError):
        return None
    plain = all(isinstance(name, str) for name in own)
    return dict(found) if whole and plain and all(Path(f).name == f for f in found["files"].values()) else None


def fresh(choices: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the records of some choices that came after the plan of the next record; none where there is no plan."""
    planned = plan_of(choices)
    return [r for r in choices["records"] if r["file"] not in planned["records"]] if planned else []


def _claimed(file: Path) -> bool:
    """Make an empty file, and tell whether none was there, nor a link."""
    try:
        os.close(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
    except FileExistsError:
        return False
    return True


def lock(store: Path, port: int) -> int:
    """Return the descriptor of a store that is locked until this process ends; ``port``: where it listens.

    Raises `InputError` where another server has it: two would overwrite what the other one writes. Who has it stands
    beside what was agreed to on this machine (`trust`), not in the store.
    """
    store.mkdir(exist_ok=True)
    held = os.open(store, os.O_RDONLY | os.O_DIRECTORY)
    note = trust.place().with_name(f"server_{trust.digest(os.fsencode(store.resolve()))[:16]}.json")
    try:
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(held)
        said = ""
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            other = json.loads(note.read_text(encoding="utf-8"))
            said = f", pid {int(other['pid'])}, port {int(other['port'])}"
        raise InputError(f"{store.resolve()}: project is open in another server{said}") from None
    except OSError:
        return held  # a file system without locks
    with contextlib.suppress(OSError):
        note.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        write_text(note, json.dumps({"pid": os.getpid(), "port": port}))
    return held


class Project:
    """A folder below ``.signlin`` and what is in it; every change is on the disk before anything else happens."""

    def __init__(self, store: Path, identity: str) -> None:
        if not _ID.match(identity):
            raise InputError("no such project")
        self.id, self.folder = identity, store / identity
        self._held: dict[str, Any] = {}
        self._check_links()
        self.state: dict[str, Any] = json.loads((self.folder / "state.json").read_text(encoding="utf-8"))
        if self.state.get("version") != VERSION:
            raise InputError(f"{self.folder}: was written by another version of signlin")
        self.interrupted = self.state.get("running")
        """What ran when the server ended, before it was done."""

    # ---------------------------------------------------------------- opening

    @classmethod
    def create(cls, store: Path) -> Project:
        """Make a new, empty project."""
        identity = secrets.token_hex(6)
        folder = store / identity
        (folder / "results").mkdir(parents=True)
        state = {
            "version": VERSION,
            "created": time.time(),
            "choices": EMPTY_PROJECT,
            "past": [],
            "future": [],
            "count": 0,
        }
        write_text(folder / "state.json", json.dumps(state))
        return cls(store, identity)

    @classmethod
    def listed(cls, store: Path) -> list[str]:
        """Return the projects of a store, the latest used first."""
        found = [f for f in store.glob("*/state.json") if _ID.match(f.parent.name)] if store.is_dir() else []
        return [f.parent.name for f in sorted(found, key=lambda f: f.stat().st_mtime, reverse=True)]

    @classmethod
    def titles(cls, store: Path) -> list[dict[str, Any]]:
        """Return the latest projects: identity, what is in it, and when it was used last (s since 1970)."""
        return [cls._title(store, identity) for identity in cls.listed(store)[:MAX_LISTED_PROJECTS]]

    @classmethod
    def _title(cls, store: Path, identity: str) -> dict[str, Any]:
        file = store / identity / "state.json"
        state = json.loads(file.read_text(encoding="utf-8"))
        choices = state["choices"]
        names = [Path(name).name for name in (choices["model"], *(r["file"] for r in choices["records"])) if name]
        named = str(state.get("name") or "")
        return {
            "id": identity,
            "title": named or ", ".join(names) or "empty",
            "named": named,
            "used": file.stat().st_mtime,
        }

    def rename(self, name: str) -> None:
        """Call the project something; nothing: by what is in it."""
        plain = " ".join("".join(c if c.isprintable() else " " for c in name).split())
        self.state["name"] = plain[:MAX_NAME_LENGTH]
        self._save()

    def copied(self, store: Path) -> Project:
        """Return a new project with all that is in this one but results, which are found again."""
        copy = Project.create(store)
        for file in self.folder.iterdir():
            if file.is_file() and not file.name.startswith("."):
                shutil.copy2(file, copy.folder / file.name)
        copied = Project(store, copy.id)
        copied.state |= {"created": time.time(), "running": None}
        copied.rename(f"copy of {self._title(store, self.id)['title']}")
        return copied

    def delete(self) -> None:
        """Delete the folder and all that is in it."""
        self._check_links()
        shutil.rmtree(self.folder)

    # ---------------------------------------------------------------- choices

    @property
    def choices(self) -> dict[str, Any]:
        """What is chosen now; change it with `change` only."""
        return dict(self.state["choices"])

    def change(self, label: str, **choices: Any) -> None:
        """Choose something, in a way that can be taken back."""
        self.state["past"] = [*self.state["past"], {"label": label, "choices": self.state["choices"]}][-UNDO:]
        self.state["future"] = []
        self.amend(**{"exported": False, **choices})

    @property
    def step(self) -> tuple[int, str]:
        """How many steps can be taken back, and what the last one was."""
        past = self.state["past"]
        return len(past), past[-1]["label"] if past else ""

    def amend(self, **choices: Any) -> None:
        """Change what is chosen as a part of the step before."""
        self.state["choices"] = copy.deepcopy({**self.state["choices"], **choices})
        self._save()

    def running(self, what: dict[str, str] | None) -> None:
        """Note what runs, so that it is known where the server ends before it is done; None: nothing."""
        if self.state.get("running") != what:
            self.state["running"] = what
            self._save()

    def undo(self) -> None:
        """Take the last step back."""
        self._turn("past", "future")

    def redo(self) -> None:
        """Take again what was taken back."""
        self._turn("future", "past")

    def take_back(self) -> None:
        """Take the last step back, for good."""
        self.undo()
        self.state["future"] = self.state["future"][:-1]
        self._save()

    def _turn(self, source: str, target: str) -> None:
        if not self.state[source]:
            return
        last = self.state[source].pop()
        self.state[target].append({"label": last["label"], "choices": self.state["choices"]})
        self.state["choices"] = last["choices"]
        self._save()

    def _save(self) -> None:
        write_text(self.folder / "state.json", json.dumps(self.state))

    # ---------------------------------------------------------------- files

    def path(self, name: str) -> str:
        """Return how a file is called from where the server was started; the name of a shipped model stays."""
        if "." not in name and "/" not in name:
            return name
        found = os.path.relpath(name if Path(name).is_absolute() else self.folder / name)
        return name if Path(name).is_absolute() and found.startswith(os.pardir) else found

    def place(self, name: str = "") -> str:
        """Return how the folder, or something in it, is called from where the server was started."""
        return os.path.relpath(self.folder / name)

    def free_names(self, name: str) -> Iterator[Path]:
        """Yield safe paths in the folder for a file that is dropped, beside those of the same name."""
        plain = safe_name(name)
        end = RIVALS if plain.endswith(RIVALS) else Path(plain).suffix
        for number in range(10_000):
            file = self.folder / (f"{plain.removesuffix(end)}_{number}{end}" if number else plain)
            if not os.path.lexists(file):
                yield file
        raise InputError(f"{name}: too many files of that name")

    def free_name(self, name: str) -> Path:
        """Return the first of `free_names`."""
        return next(self.free_names(name))

    def placed(self, part: Path, name: str) -> str:
        """Give a file that was received its name, and return it: never that of another file, come at once as it may."""
        for file in self.free_names(name):
            if _claimed(file):
                part.replace(file)
                return file.name
        raise InputError(f"{name}: too many files of that name")

    def next_model(self) -> str:
        """Return the name of the next model version, which no file has."""
        while True:
            self.state["count"] += 1
            name = f"model_{self.state['count']}.yaml"
            if _claimed(self.folder / name):
                self._save()
                return name

    def next_plan(self) -> str:
        """Return what the files of the next plan are called before their endings."""
        count = 1
        while any(self.folder.glob(f"next_{count}.*")):
            count += 1
        return f"next_{count}"

    def release(self, name: str) -> None:
        """Give a name of `next_model` back where nothing was written to it."""
        file = self.folder / name
        if file.is_file() and file.stat().st_size == 0:
            file.unlink()

    def made(self, name: str) -> Path:
        """Return a folder of the project that results go to, made if need be; a link is refused."""
        self._check_links()
        folder = self.folder / name
        folder.mkdir(exist_ok=True)
        return folder

    def _check_links(self) -> None:
        """Refuse symbolic links in the folder: what is written to them is written elsewhere."""
        for file in (self.folder, *self.folder.rglob("*")):
            if file.is_symlink():
                raise InputError(f"{file}: is a symbolic link; a project holds none: copy the file, or remove the link")

    def files(self, role: str) -> list[str]:
        """Return the paths of the records of a role."""
        return [self.path(r["file"]) for r in self.state["choices"]["records"] if r["role"] == role]

    # ---------------------------------------------------------------- results

    def key(self, verb: str, asked: Mapping[str, Any]) -> str:
        """Return the key of a result: what was asked, and of which files as they are now."""
        text = json.dumps([ANSWERS, verb, asked], sort_keys=True)
        read = (asked.get(name) or () for name in ("model", "file", "files", "data", "validation", "rivals"))
        files = [f for given in read for f in ([given] if isinstance(given, str) else given)]
        stats = [Path(f).stat() for f in files if Path(f).is_file()]
        stamps = [(stat.st_size, stat.st_mtime_ns) for stat in stats]
        return f"{verb}-{hashlib.sha256(f'{text}{stamps}'.encode()).hexdigest()[:20]}"

    def result(self, key: str) -> Any:
        """Return the stored result of a key, None where there is none; not to be changed."""
        if key not in self._held:
            file = self.folder / "results" / f"{key}.json"
            try:
                self._held[key] = json.loads(file.read_text(encoding="utf-8"))
            except (FileNotFoundError, ValueError):
                return None
        return self._held[key]

    def keep(self, key: str, found: Mapping[str, Any]) -> None:
        """Keep what was found."""
        write_text(self.folder / "results" / f"{key}.json", json.dumps(found))

    def array_file(self, key: str) -> Path:
        """Return where the curves of a result stand."""
        return self.folder / "results" / f"{key}.npz"


__all__ = [
    "DROPPED_SUFFIXES",
    "EMPTY_PROJECT",
    "MODELS",
    "RIVALS",
    "ROBOTS",
    "STORE",
    "Project",
    "fresh",
    "lock",
    "plan_of",
    "safe_name",
]
