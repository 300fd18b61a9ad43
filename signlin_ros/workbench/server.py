"""The web application: every handler reads a request, asks a session, writes an answer."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import socket
import threading
import webbrowser
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from types import FrameType
from typing import Any

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, RedirectResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from signlin_ros.errors import InputError, one_line
from signlin_ros.workbench import columns, plans, questions, safety
from signlin_ros.workbench.actions import ACTIONS
from signlin_ros.workbench.formats import FILES
from signlin_ros.workbench.lane import FaultError, LaneCancelledError, RefusedError
from signlin_ros.workbench.live import Live
from signlin_ros.workbench.project import STORE, Project, lock, plan_of, safe_name
from signlin_ros.workbench.receiving import asked, received
from signlin_ros.workbench.session import Session
from signlin_ros.workbench.template import WorkerTemplate

STATIC = Path(__file__).parent / "static"
AWAKE = 3
"""Projects that keep their worker processes (some 200 MB each) while others are looked at."""
MAX_OPEN_PROJECTS = 8
"""So many projects are open at a time; the one not looked at for longest is closed first."""
BEAT = 5.0
"""Seconds after which a silent stream of events says which state there is; pages that show another one ask for it."""
ENDED = {"kind": "ended"}
"""What ends a stream of events."""
EXPORTED = ("model.yaml", "report.html", "replay.sh", *(name for names in FILES.values() for name in names))
SESSION = "signlin_project"


class Workbench:
    """The projects of a folder, those that are open, and what the command line named."""

    def __init__(self, store: Path, given: Sequence[str] = (), sample: bool = False, live: Sequence[str] = ()) -> None:
        self.store, self.given, self.sample = store, tuple(given), sample
        self.sessions: dict[str, Session] = {}
        self.ended = False
        self.live = Live(live)
        self.template = WorkerTemplate()

    def session(self, identity: str) -> Session:
        """Return the session of a project, opened if need be; raises `InputError` where there is no such project."""
        latest = next(reversed(self.sessions), None)
        found, opened = self.sessions.pop(identity, None), latest != identity
        if found is None:
            if identity not in Project.listed(self.store):
                raise InputError("no such project")
            found = Session(Project(self.store, identity), self.template)
            self._close_one()
        self.sessions[identity] = found
        if opened:
            self._let_rest()
        return found

    def end(self) -> None:
        """End all streams, and those that still come: they would last as long as somebody looks."""
        self.ended = True
        for session in self.sessions.values():
            for listener in session.listeners:
                listener.put_nowait(ENDED)
        self.live.end()

    async def drop(self, session: Session) -> None:
        """Close a project and delete it; pages that show it are told that it is gone."""
        self.sessions.pop(session.project.id, None)
        for listener in session.listeners:
            listener.put_nowait(ENDED)
        await session.close()
        session.project.delete()

    def _let_rest(self) -> None:
        """End the worker processes of projects that were looked at before the latest ones."""
        for session in [s for s in self.sessions.values() if s.busy is None][:-AWAKE]:
            session.rest()

    def _close_one(self) -> None:
        idle = [k for k, s in self.sessions.items() if s.busy is None and not s.listeners]
        if len(self.sessions) >= MAX_OPEN_PROJECTS and idle:
            closing = asyncio.get_running_loop().create_task(self.sessions.pop(idle[0]).close())
            closing.add_done_callback(lambda _: None)

    def entry(self, remembered: str | None) -> Session:
        """Return the project to begin with: that of the command line, the browser's own, the last one, or a new one."""
        known = Project.listed(self.store)
        if self.given:
            files, self.given = self.given, ()
            session = self.session(Project.create(self.store).id)
            session.start("record", "reading", lambda: _take_given(session, files))
            return session
        if self.sample:
            self.sample = False
            session = self.session(Project.create(self.store).id)
            session.start("record", "making the sample", session.take_sample)
            return session
        if remembered in known:
            return self.session(str(remembered))
        free = [k for k in known if k not in self.sessions or not self.sessions[k].listeners]
        if known and free and free[0] == known[0]:
            return self.session(known[0])
        return self.session(Project.create(self.store).id)


async def _take_given(session: Session, files: Sequence[str]) -> None:
    model, *records = files
    there = Path(model).exists()
    session.project.change("open", model=str(Path(model).absolute()) if there else model)
    await session.take([str(Path(f).absolute()) for f in records])


# -------------------------------------------------------------------- handlers


def _bench(request: Request) -> Workbench:
    found: Workbench = request.app.state.workbench
    return found


def _session(request: Request) -> Session:
    return _bench(request).session(request.path_params["project"])


async def entry(request: Request) -> Response:
    """Lead to a project."""
    session = _bench(request).entry(request.cookies.get(SESSION))
    return RedirectResponse(f"/p/{session.project.id}", 303)


async def page(request: Request) -> Response:
    """Return the page of a project."""
    session = _session(request)
    answer = FileResponse(STATIC / "index.html")
    answer.set_cookie(SESSION, session.project.id, httponly=True, samesite="strict", max_age=31_536_000)
    return answer


async def state(request: Request) -> Response:
    """Return all that the page shows but curves."""
    return JSONResponse(_session(request).shown(), headers={"cache-control": "no-store"})


async def new(request: Request) -> Response:
    """Make a new project."""
    bench = _bench(request)
    return JSONResponse({"id": bench.session(Project.create(bench.store).id).project.id})


async def projects(request: Request) -> Response:
    """Return the projects of this folder, the latest used first."""
    return JSONResponse(Project.titles(_bench(request).store), headers={"cache-control": "no-store"})


async def arrange(request: Request) -> Response:
    """Rename, duplicate or delete a project; returns the one to go on with."""
    bench, args, verb = _bench(request), await asked(request), request.path_params["verb"]
    session = bench.session(request.path_params["project"])
    session.idle()
    if verb == "rename":
        session.project.rename(str(args.get("name") or ""))
        session.tell()
        return JSONResponse({"id": session.project.id})
    if verb == "duplicate":
        return JSONResponse({"id": session.project.copied(bench.store).id})
    if verb != "delete":
        raise InputError(f"no such action: {verb[:80]!r}")
    await bench.drop(session)
    known = Project.listed(bench.store)
    return JSONResponse({"id": known[0] if known else Project.create(bench.store).id})


async def action(request: Request) -> Response:
    """Do what a click asks for."""
    session, args = _session(request), await asked(request)
    name = request.path_params["action"]
    if name not in ACTIONS:
        raise InputError(f"no such action: {name[:80]!r}")
    await ACTIONS[name](session, args)
    session.tell()
    return JSONResponse({"ok": True})


async def curves(request: Request) -> Response:
    """Return curves, or what the sliders ask for; passed on from the worker unread."""
    session, args = _session(request), await asked(request)
    verb, wanted = _view_question(session, request.path_params["what"], args)
    return Response(await session.view.raw(verb, wanted), media_type="application/json")


_COMPARISON_CALLS = {"compare": "compare_curves", "xy": "compare_xy"}
_RECORD = {"record": "record_curves", "search": "search"}


def _view_question(session: Session, what: str, args: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """Return verb and arguments of a view; files are named by the project, never by the page."""
    wanted = {k: args.get(k) for k in ("from", "to", "points", "stretch", "how", "at")}
    records = session.project.choices["records"]
    if what in _RECORD and records:
        record = records[min(int(args.get("record") or 0), len(records) - 1)]
        wanted |= {"columns": args.get("columns"), "filter": args.get("filter")}
        return _RECORD[what], {**wanted, **columns.asked_of(session, record)}
    if what in ("compare", "xy"):
        asked = questions.question(session, "compare")
        key = session.project.key("compare", asked)
        found = session.project.result(key)
        if found is not None:
            stores = {one: str(session.project.array_file(one)) for one in (key, *session.compared())}
            also = [stores[one] for one in args.get("also") or () if one in stores]
            shown = {"channels": found["channels"], "inputs": found["inputs"], "also": also}
            more = {"x": args.get("x"), "y": args.get("y")} if what == "xy" else {}
            return _COMPARISON_CALLS[what], {**wanted, **shown, **more, "store": stores[key]}
    if what == "tune" and columns.complete(session):
        asked = questions.question(session, "compare")
        values = {str(k): float(v) for k, v in dict(args.get("values") or {}).items()}
        return "tune", {**wanted, **asked, "file": asked["data"][0], "values": values}
    planned = plan_of(session.project.choices)
    if what == "plan" and planned is not None and planned["asked"]:
        key = session.project.key("experiment", planned["asked"])
        found = session.project.result(key)
        way = int(args.get("way") or 0)
        if found is not None and 0 <= way < max(len(found["previews"]), 1):
            command, channels = found["json"]["command"], [p["channels"] for p in found["previews"]]
            shown = {"input": command["input"], "unit": command["unit"], "way": way}
            shown["channels"] = channels[way] if channels else {}
            return "plan_curves", {**wanted, **shown, "store": str(session.project.array_file(key))}
    raise InputError(f"nothing to show for {what!r}")


async def upload(request: Request) -> Response:
    """Take a file that was dropped, as the body of the request."""
    session = _session(request)
    name = safe_name(request.query_params.get("name", ""))
    part = await received(request, session.project.folder, name)
    try:
        return JSONResponse({"file": session.project.placed(part, name)})
    finally:
        part.unlink(missing_ok=True)


async def events(request: Request) -> Response:
    """Stream what happens in a project: changes and progress."""
    session = _session(request)
    listener: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
    session.listeners.add(listener)
    if _bench(request).ended:
        listener.put_nowait(ENDED)
    else:
        session.wake()

    async def stream() -> AsyncIterator[str]:
        try:
            yield "retry: 500\n\n"
            while (told := await _next(listener)) != ENDED:
                beat = {"kind": "beat", "serial": session.serial}
                yield f"data: {json.dumps(told or beat)}\n\n"
        finally:
            session.listeners.discard(listener)

    return StreamingResponse(stream(), media_type="text/event-stream")


async def _next(listener: asyncio.Queue[dict[str, Any]]) -> dict[str, Any] | None:
    """Return the next event of the stream, None after a while without one."""
    try:
        return await asyncio.wait_for(listener.get(), BEAT)
    except (TimeoutError, asyncio.TimeoutError):  # two classes on Python 3.10
        return None


async def live(request: Request) -> Response:
    """Stream what a running system does."""
    feed = _bench(request).live
    lines = await feed.join()

    async def stream() -> AsyncIterator[str]:
        try:
            while line := await lines.get():
                yield f"data: {line}\n\n"
        finally:
            await feed.leave(lines)

    return StreamingResponse(stream(), media_type="text/event-stream")


async def take_live(request: Request) -> Response:
    """Take the last seconds of a running system as a record of the project."""
    session, args = _session(request), await asked(request)
    target = session.project.free_name("live.csv")
    model = questions.described(session) or {}
    names = [list(model.get(k, ())) for k in ("states", "inputs")]
    done = await _bench(request).live.take(float(args.get("seconds") or 30.0), str(target), *names)
    if not done["taken"]:
        raise InputError(done["why"])
    session.start("record", "reading", lambda: session.take([target.name]), waits=True)
    return JSONResponse({"file": target.name, "samples": done["samples"]})


async def exported(request: Request) -> Response:
    """Return one of the exported files."""
    session, name = _session(request), request.path_params["name"]
    file = session.project.folder / "export" / name
    if plans.PLAN_FILES.fullmatch(name) and (session.project.folder / name).is_file():
        return FileResponse(session.project.folder / name, filename=name, media_type="application/octet-stream")
    if name not in EXPORTED or not file.is_file():
        raise InputError(f"no such file: {name!r}")
    if name.endswith(".html"):
        return FileResponse(file, headers={"content-security-policy": safety.REPORT_POLICY})
    return FileResponse(file, filename=f"{session.project.id}_{name}", media_type="application/octet-stream")


async def refused(request: Request, error: Exception) -> Response:
    """Say what was wrong with a request."""
    return JSONResponse({"what": one_line(error)}, 404 if "no such" in str(error) else 400)


async def failed(request: Request, error: Exception) -> Response:
    """Say what failed here."""
    return JSONResponse({"what": str(error), "fault": True}, 500)


# -------------------------------------------------------------------- starting


def application(bench: Workbench, hosts: Sequence[str] = safety.LOCAL, token: str | None = None) -> Starlette:
    """Return the application behind its gate."""
    project = [
        Route("/", page),
        Route("/state", state),
        Route("/do/{action}", action, methods=["POST"]),
        Route("/show/{what}", curves, methods=["POST"]),
        Route("/files", upload, methods=["PUT"]),
        Route("/events", events),
        Route("/live", live),
        Route("/live/take", take_live, methods=["POST"]),
        Route("/export/{name}", exported),
    ]
    routes = [
        Route("/", entry),
        Route("/new", new, methods=["POST"]),
        Route("/projects", projects),
        Route("/projects/{project}/{verb}", arrange, methods=["POST"]),
        Mount("/static", StaticFiles(directory=STATIC)),
        Route("/p/{project}", page),
        Mount("/p/{project}", routes=project),
    ]
    handlers: Any = {
        InputError: refused,
        RefusedError: refused,
        LaneCancelledError: refused,
        FaultError: failed,
        ValueError: refused,
        TypeError: refused,
    }

    @contextlib.asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        app.state.loop = asyncio.get_running_loop()
        yield
        await asyncio.gather(bench.live.close(), *(s.close() for s in bench.sessions.values()))
        await bench.template.close()

    gate = Middleware(safety.Gate, hosts=hosts, token=token)
    app = Starlette(routes=routes, middleware=[gate], exception_handlers=handlers, lifespan=lifespan)
    app.state.workbench = bench
    return app


def serve(
    given: Sequence[str] = (),
    host: str | None = None,
    port: int = 0,
    show: bool = True,
    sample: bool = False,
    live: Sequence[str] = (),
) -> None:
    """Serve the page until interrupted; raises `InputError` where the address cannot be had.

    ``live``: options of `signlin_ros.nodes.feed`.
    """
    import uvicorn

    token = None if host is None else safety.new_token()
    bench = Workbench(Path(STORE), given, sample, live)
    listening = _listening(host or "127.0.0.1", port)
    held = lock(Path(STORE), listening.getsockname()[1])
    shown = host if host not in (None, "0.0.0.0", "::") else "127.0.0.1"
    address = f"http://{shown}:{listening.getsockname()[1]}/" + (f"?token={token}" if token else "")
    print(f"workbench: {address}  (Ctrl+C ends it; the project stays in {STORE}/)", flush=True)  # noqa: T201
    if show:
        threading.Timer(0.3, webbrowser.open, [address]).start()
    app = application(bench, token=token)

    class Server(uvicorn.Server):
        def handle_exit(self, sig: int, frame: FrameType | None) -> None:
            app.state.loop.call_soon_threadsafe(bench.end)
            super().handle_exit(sig, frame)

    options: Any = {"log_level": "warning", "timeout_graceful_shutdown": 3, "ws": "none"}
    try:
        Server(uvicorn.Config(app, **options)).run(sockets=[listening])
    finally:
        os.close(held)


def _listening(host: str, port: int) -> socket.socket:
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        return socket.create_server((host, port), family=family)
    except OSError as error:
        raise InputError(f"cannot listen on {host}, port {port}: {error.strerror or error}") from error


__all__ = ["Workbench", "application", "serve"]
