"""One project with its two worker processes, and what every click does. No numerics: `calls` is asked for them."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

from signlin_ros.errors import InputError, one_line
from signlin_ros.files import write_text
from signlin_ros.names import printed_name
from signlin_ros.workbench import columns, plans, questions, stages
from signlin_ros.workbench.formats import FILES
from signlin_ros.workbench.lane import FaultError, Lane, LaneCancelledError, RefusedError
from signlin_ros.workbench.project import MODELS, RIVALS, ROBOTS, Project
from signlin_ros.workbench.shown import shown
from signlin_ros.workbench.template import WorkerTemplate

Args = dict[str, Any]
Job = Callable[[], Coroutine[Any, Any, None]]
FAULT = "This is a fault of signlin; please report it with the command and its files."
MAX_PENDING_EVENTS = 500
"""Events that a page may be behind; then it is told to look at the state anew instead."""
PLANNING = "planning"
"""How what is told of a plan begins: its errors stand below the diagnosis, and have another advice."""
GIVES_WAY = 5
"""By how much what takes long gives way to what is looked at, as `nice` counts."""


class Session:
    """A project that is open. ``view`` answers at once (curves, sliders), ``work`` takes long and can be cancelled;
    both are copies of a ``template``, where there is one.
    """

    def __init__(self, project: Project, template: WorkerTemplate | None = None) -> None:
        self.project = project
        self.view, self.work = (Lane(Path.cwd(), nice, template) for nice in (0, GIVES_WAY))
        self.busy: dict[str, Any] | None = None
        self.errors: dict[str, dict[str, str]] = {}
        self.code: list[dict[str, str]] = []
        if self.project.interrupted:
            self.errors[self.project.interrupted["stage"]] = stages.interrupted(self.project.interrupted)
        self.shipped: list[dict[str, Any]] = []
        self.forms: list[dict[str, Any]] = []
        self.tables: list[columns.Table] | None = None
        self.listeners: set[asyncio.Queue[dict[str, Any]]] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._turn = asyncio.Lock()
        self._awake = False
        self._life, self._count = secrets.token_hex(4), 0

    # ---------------------------------------------------------------- telling the page

    @property
    def serial(self) -> str:
        """Name of the state as it is: another one after every change, and after every start of the server."""
        return f"{self._life}-{self._count}"

    def tell(self, kind: str = "state", **more: Any) -> None:
        """Tell every page that shows this project; what a slow one has not heard yet shrinks to "look again"."""
        if kind == "state":
            self._count += 1
        for listener in self.listeners:
            told = {"kind": kind, **more}
            if listener.qsize() >= MAX_PENDING_EVENTS:
                told = {"kind": "state"}
                while not listener.empty():
                    listener.get_nowait()
            listener.put_nowait(told)

    def _progress(self, told: dict[str, Any]) -> None:
        if self.busy is not None:
            self.busy.update({k: told[k] for k in ("what", "share", "found") if told.get(k) is not None})
            self.tell("progress", busy=self.busy)

    def shown(self) -> dict[str, Any]:
        """Return all that the page shows but curves."""
        return shown(self)

    def compared(self) -> list[str]:
        """Return the keys of all comparisons on the way to this model."""
        done = (step for step in self.project.choices["path"] if step["verb"] == "compare")
        return [self.project.key("compare", questions.asked_of(step)) for step in done]

    # ---------------------------------------------------------------- asking

    async def asked(self, lane: Lane, verb: str, args: Args, **more: Any) -> Any:
        """Return the answer of a verb, from the disk if it was asked before; ``more`` is not part of the question."""
        key = self.project.key(verb, args)
        found = self.project.result(key)
        if found is None:
            if self.busy is not None and self.busy.get("cancelled"):
                raise LaneCancelledError
            store = str(self.project.array_file(key))
            found = await lane.call(verb, {**args, **more, "store": store, "key": key}, self._progress)
            self.project.keep(key, found)
        return found

    def start(self, stage: str, what: str, job: Job, *, waits: bool = False) -> None:
        """Do something that takes its time; one thing at a time, after what runs already if it ``waits``.

        Raises `InputError` where something runs already and it does not wait.
        """
        if not waits:
            self.idle()
        self.later(lambda: self._guarded({"stage": stage, "what": what, "share": 0.0, "found": None}, job))
        if self.busy is None:
            self.busy = {"stage": stage, "what": what, "share": 0.0, "found": None}

    def idle(self) -> None:
        """Raise `InputError` where something runs: nothing is changed meanwhile."""
        if self.busy is not None:
            raise InputError(f"{self.busy['stage']} is still running; wait for it or cancel it")

    def change(self, label: str, stage: str, what: str, job: Job, **choices: Any) -> None:
        """Choose something and do what follows from it; nothing of both where something runs already."""
        self.idle()
        self.project.change(label, **choices)
        self.start(stage, what, job)

    def later(self, job: Job) -> None:
        """Do something beside all else."""
        task = asyncio.get_running_loop().create_task(job())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _guarded(self, busy: dict[str, Any], job: Job) -> None:
        async with self._turn:
            self.busy = busy
            self.errors.pop(busy["stage"], None)
            self.tell()
            before = self.project.step
            try:
                self.project.running({"stage": busy["stage"], "what": busy["what"]})
                await job()
                self.code = []
            except LaneCancelledError:
                now = self.project.step
                kept = "Nothing was changed" if now == before else f'"{now[1]}" was done before; undo takes it back'
                self.errors[busy["stage"]] = {"what": "Cancelled.", "do": f"{kept}; start it again when you like."}
            except (RefusedError, InputError) as error:
                self.code = getattr(error, "files", [])
                stage = "plan" if busy["what"].startswith(PLANNING) else busy["stage"]
                self.errors[busy["stage"]] = stages.advice(stage, one_line(error), bool(self.code))
            except OSError as error:
                what = f"{error.filename or self.project.place()}: {error.strerror or error}"
                do = "Make room, or the right to write there, and try again."
                self.errors[busy["stage"]] = {"what": what, "do": do}
            except FaultError as error:
                self.errors[busy["stage"]] = {"what": str(error), "do": FAULT}
            except Exception as error:
                self.errors[busy["stage"]] = {"what": f"{type(error).__name__}: {error}", "do": FAULT}
                raise
            finally:
                with contextlib.suppress(OSError):
                    self.project.running(None)
                self.busy = None
                self.tell()

    def wake(self) -> None:
        """Start the workers: somebody looks; read again what has changed."""
        if (stages.changed(self) or columns.unread(self)) and "record" not in self.errors:
            self.start("record", "reading", self.look_again)
        if not self._awake:
            self._awake = True
            self.later(self._look_around)

    async def models(self) -> list[dict[str, Any]]:
        """Return the shipped models."""
        if not self.shipped:
            found = await self.view.call("models", {})
            self.shipped, self.forms = found["models"], found["forms"]
        return self.shipped

    async def _look_around(self) -> None:
        """Start the workers, and learn which models are shipped; what was cancelled is done for the next who looks."""
        try:
            await self.models()
            self.tell()
            await self.view.call("reader", {})
            await self.work.call("ready", {})
        except (LaneCancelledError, RefusedError, FaultError):
            self._awake = False

    async def cancel(self) -> None:
        """Stop what runs, wherever it runs; what it would ask for next is not asked any more."""
        if self.busy is not None:
            self.busy["cancelled"] = True
        lanes = [self.work, *([self.view] if self.busy and self.busy["stage"] == "record" else [])]
        await asyncio.gather(*(lane.cancel() for lane in lanes))

    def rest(self) -> None:
        """End the worker processes once they do nothing; they are started again when they are asked."""
        self._awake = False
        for lane in (self.view, self.work):
            self.later(lane.rest)

    async def close(self) -> None:
        """End the worker processes."""
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(self.view.cancel(), self.work.cancel())

    # ---------------------------------------------------------------- record

    async def take(self, files: list[str]) -> None:
        """Take files of the folder that were just dropped, or that the command line named: models and records."""
        choices = self.project.choices
        made = [f for f in files if f.lower().endswith(MODELS)]
        beside = [f for f in files if f.lower().endswith(ROBOTS)]
        rivals = [f for f in files if f.lower().endswith(RIVALS)]
        known = {*made, *beside, *rivals}
        records = [*choices["records"], *({"file": f, "role": ""} for f in files if f not in known)]
        for model in made:
            await self.view.call("describe", {"model": self.project.path(model), "uploaded": True})
        model = made[-1] if made else choices["model"]
        label = ", ".join(Path(f).name for f in files)
        guessed = not made and choices.get("guessed", False)
        anew: Args = {"path": [], "cures": [], "guessed": guessed}
        if rivals:
            anew["planned"] = await self._plan_of(rivals[-1], model)
        records = _with_roles(records)
        plans.one_to_judge({**choices, **anew}, records)
        self.project.change(f"drop {label}", records=records, model=model, **anew)
        await self.look()

    async def _plan_of(self, file: str, model: str | None) -> Args:
        """Return what is known of a plan whose rivals were dropped: every record is judged by them."""
        found = await self.view.call("rivals", {"file": self.project.path(file)})
        own = {"names": found["rivals"], "files": {"rivals": file}}
        return {"asked": None, "model": model, "records": [], **own}

    async def take_sample(self) -> None:
        """Make the sample, and take it."""
        files = (await self.work.call("sample", {"folder": str(self.project.folder)}))["files"]
        self.project.change("sample", model=None, records=[], cures=[], path=[], planned=None)
        await self.take([Path(file).name for file in files])

    async def look_again(self) -> None:
        """Read what is chosen, and keep what was said of other stages: that something was interrupted there."""
        held = {stage: error for stage, error in self.errors.items() if stage not in ("record", "check")}
        await self.look()
        self.errors |= held

    async def look(self) -> None:
        """Read what is chosen: columns, model, mapping; then check it."""
        self.errors = {}
        choices = self.project.choices
        if choices["model"] is not None:
            await self.view.call("code", {"model": self.project.path(choices["model"])})
        for record in choices["records"]:
            await self.asked(self.view, "columns", columns.asked_of(self, record))
            self.tell()
        self.project.amend(records=columns.inherited(self))
        if choices["model"] is None and choices["records"]:
            await self._guess_model()
        if self.project.choices["model"] is not None:
            await self._map()
        if columns.complete(self):
            if self.busy is not None:
                self.busy.update(stage="check", what="checking")
                self.tell()
            await self._checked()

    async def look_or_back(self, file: str) -> None:
        """Read anew; where a record that could be read cannot be any more, take the last step back and say why."""
        await self.look()
        why = next((columns.fault(self, r) for r in self.project.choices["records"] if r["file"] == file), "")
        if why:
            self.project.take_back()
            await self.look()
            if self.busy is not None:
                self.busy["stage"] = "record"
            raise InputError(f"It is left as it was: {why.replace(f'{self.project.place()}/', '')}")

    async def _guess_model(self) -> None:
        """Choose the shipped model whose inputs are all in the records, if one is."""
        for name in ("dc_motor", "mass_spring_damper", "force_element"):
            known = [group for group in columns.groups(self) if columns.readable(self, group)]
            if not known:
                return
            asked = [columns.question(self, group, name) for group in known]
            found = [await self.asked(self.view, "propose", one) for one in asked]
            if all(_sure(answer["mapping"]) for answer in found):
                self.project.amend(model=name, guessed=True)
                return

    async def _map(self) -> None:
        """Describe the model, and ask which columns of the records it is read from."""
        await self.asked(self.view, "describe", {"model": self.project.path(self.project.choices["model"])})
        for group in columns.groups(self):
            if columns.readable(self, group):
                await self.asked(self.view, "propose", columns.question(self, group))

    async def _checked(self) -> None:
        await self.asked(self.work, "check", questions.question(self, "check"))
        self._done(questions.step(self, "check"))

    # ---------------------------------------------------------------- compare, diagnose, add

    async def compare(self) -> None:
        """Compare the model with the records that no fit sees, or with all where there are none."""
        question = questions.question(self, "compare")
        await self.asked(self.work, "compare", question)
        self._done(questions.step(self, "compare"))

    async def diagnose(self) -> None:
        """Ask what is missing."""
        step = questions.question(self, "diagnose")
        await self.asked(self.work, "diagnose", step)
        self._done({"verb": "diagnose", **step})

    async def plan(self, asked: Args) -> None:
        """Plan what to record next for the diagnosis as it is; ``asked``: see `plans.asked`."""
        diagnosis = questions.result(self, "diagnose", questions.question(self, "diagnose"))
        found = await self.asked(self.work, "experiment", asked, diagnosis=diagnosis["json"])
        name, project = self.project.next_plan(), self.project
        files = {"csv": f"{name}.csv", "rivals": f"{name}{RIVALS}"}
        files |= {"trajectory": f"{name}.trajectory.yaml"} if found["trajectory"] else {}
        for kind, file in files.items():
            write_text(project.folder / file, found[kind])
        self._done({"verb": "experiment", **asked, "output": project.path(files["csv"])})
        records = [r["file"] for r in project.choices["records"]]
        own = {"names": found["json"]["rivals"], "files": files, "records": records}
        project.change("plan what to record next", planned={"asked": asked, "model": project.choices["model"], **own})

    async def add(self, effect: str, **more: Any) -> None:
        """Add an effect, fit it, and compare anew."""
        output = self.project.next_model()
        asked = {**questions.question(self, "add"), "effect": effect, **more, "output": self.project.path(output)}
        with contextlib.ExitStack() as then:
            then.callback(self.project.release, output)
            await self.asked(self.work, "add", asked)
        path = [*self.project.choices["path"], {"verb": "add", **asked}]
        self.project.change(f"add {printed_name(effect)}", model=output, path=path, guessed=False)
        await self._map()
        await self._checked()
        await self.compare()

    def _done(self, step: dict[str, Any] | None) -> None:
        path = self.project.choices["path"]
        if step is not None and step not in path:
            self.project.amend(path=[*path, step])

    async def learn(self, over: str) -> None:
        """Learn what is missing as a curve over a coordinate, and compare anew."""
        await self.add("learned_force", over=over)

    async def refit(self) -> None:
        """Make a model version of the numbers that fit the records for the fit best, and compare anew."""
        output = self.project.next_model()
        asked = {**questions.question(self, "diagnose"), "output": self.project.path(output)}
        await self._set("refit", asked, output, "use the refitted values", self.work)

    async def write(self, form: Args) -> None:
        """Make a model file of the numbers of a data sheet, and read the records with it."""
        output = self.project.next_model()
        with contextlib.ExitStack() as then:
            then.callback(self.project.release, output)
            seen = [found for record in self.project.choices["records"] if (found := columns.read(self, record))]
            labels = [[c["label"], c["unit"]] for found in seen for c in found["columns"]]
            await self.view.call("written", {**form, "columns": labels, "output": self.project.path(output)})
        self.project.change("model from a data sheet", model=output, path=[], cures=[], guessed=False)
        await self.look()

    # ---------------------------------------------------------------- use

    async def keep(self, values: dict[str, float]) -> None:
        """Make a model version of what the sliders say."""
        output, before = self.project.next_model(), self.project.path(self.project.choices["model"])
        args = {"model": before, "values": values, "output": self.project.path(output)}
        await self._set("keep", args, output, "keep the sliders", self.view)

    async def _set(self, verb: str, args: Args, output: str, label: str, lane: Lane) -> None:
        """Make a model version of other numbers, and compare it."""
        with contextlib.ExitStack() as then:
            then.callback(self.project.release, output)
            await lane.call(verb, args, self._progress)
        text = Path(args["output"]).read_text(encoding="utf-8")
        step = {"verb": "set", "model": args["model"], "data": [], "output": args["output"], "text": text}
        path = [*self.project.choices["path"], step]
        self.project.change(label, model=output, path=path, guessed=False)
        await self._map()
        await self._checked()
        await self.compare()

    def export_model(self) -> None:
        """Write model and script to the folder ``export`` of the project: they are there at once."""
        folder = self.project.made("export")
        (folder / "report.html").unlink(missing_ok=True)
        model = Path(self.project.path(self.project.choices["model"]))
        described = questions.described(self)
        write_text(folder / "model.yaml", described["yaml"] if described else model.read_text(encoding="utf-8"))
        write_text(folder / "replay.sh", questions.script(self))
        self.project.amend(exported=True)

    async def use(self, target: str) -> None:
        """Write the model for another tool into the folder ``export``, and run it there."""
        asked = questions.used(self, target)
        output = str(self.project.made("export") / FILES[target][0])
        found = await self.work.call("use", {**asked, "output": output}, self._progress)
        self.project.keep(self.project.key("use", asked), found)
        self.project.amend(target=target)

    async def export(self) -> None:
        """Write the report beside them."""
        self.export_model()
        self.tell()
        folder = self.project.made("export")
        with contextlib.suppress(RefusedError):
            args = {**questions.reported(self), "report": str(folder / "report.html")}
            await self.work.call("report", args, self._progress)


def _sure(rows: list[Args]) -> bool:
    """Tell whether all that a model needs, and more, is found in records by its name."""
    sure = [r for r in rows if r["column"] and not r["proposed"]]
    return {r["signal"] for r in rows if r["needed"]} <= {r["signal"] for r in sure} and len(sure) > 1


def _with_roles(records: list[dict[str, str]]) -> list[dict[str, str]]:
    """Return records with a role each: what is called so is for validation, else the last of several."""
    for record in records:
        name = Path(record["file"]).stem.lower()
        if not record["role"]:
            record["role"] = "validation" if any(w in name for w in ("valid", "test", "unseen")) else "estimation"
    roles = [r["role"] for r in records]
    if len(records) > 1 and "validation" not in roles:
        records[-1]["role"] = "validation"
    if records and "estimation" not in roles:
        records[0]["role"] = "estimation"
    return records


__all__ = ["Session"]
