"""A functional mock-up unit (FMI 2.0, model exchange and co-simulation) of f_j, with its C sources in it."""

from __future__ import annotations

import hashlib
import platform
import shutil
import tempfile
import zipfile
from importlib import resources
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from signlin_ros.export.base import (
    Array,
    Exported,
    ExportedDrive,
    NotRunError,
    Target,
    constant_note,
    heading,
    ranges,
    refuse_imposed,
)
from signlin_ros.export.casadi_model import said_lost
from signlin_ros.export.compiler import build
from signlin_ros.export.functions import constants, identifier, smooth_rates, texts
from signlin_ros.export.lines import C, number, written
from signlin_ros.model import Model

PLATFORMS = {"Linux": ("linux64", ".so"), "Darwin": ("darwin64", ".dylib"), "Windows": ("win64", ".dll")}


class Fmu(Target):
    """An FMU; FMPy runs it as co-simulation."""

    name, suffix, engine, smooth = "fmu", ".fmu", "fmpy", True

    def write(self, model: Model, out: Path, drive: ExportedDrive) -> Exported:
        """Write the unit: description, sources, and a binary for this machine where there is a compiler."""
        refuse_imposed(model, self.name)
        name = identifier(out.stem)
        source = _model_header(model, drive)
        guid = hashlib.sha256(source.encode()).hexdigest()[:32]
        lost = list(said_lost(model))
        with tempfile.TemporaryDirectory() as folder:
            root = Path(folder)
            (root / "sources").mkdir()
            (root / "sources" / "model.h").write_text(source.replace("@GUID@", guid), encoding="utf-8")
            wrapper = (resources.files("signlin_ros.export") / "fmi2.c").read_text(encoding="utf-8")
            (root / "sources" / "fmi2.c").write_text(wrapper, encoding="utf-8")
            (root / "modelDescription.xml").write_text(_description(model, name, guid), encoding="utf-8")
            built = "sources only"
            try:
                built = _build(root, name)
            except NotRunError as error:
                lost.append(f"a binary for this machine: {error}; the sources are in the unit")
            _pack(root, out)
        return Exported(
            (out,), ("f_j as recorded, its parameters settable",), tuple(lost), {"FMI": "2.0", "binary": built}
        )

    def run(self, exported: Exported, model: Model, drive: ExportedDrive) -> dict[str, Array]:
        """Run it with FMPy, step by step, inputs held."""
        try:
            from fmpy import extract, read_model_description
            from fmpy.fmi2 import FMU2Slave
        except ImportError as error:
            raise NotRunError('fmpy is not installed (pip install "signlin_ros[export]")') from error
        if exported.settings["binary"] == "sources only":
            raise NotRunError("the unit has no binary for this machine")
        path = exported.files[0]
        said = read_model_description(str(path))
        folder = extract(str(path))
        try:
            unit = FMU2Slave(
                guid=said.guid,
                unzipDirectory=folder,
                modelIdentifier=said.coSimulation.modelIdentifier,
                instanceName="run",
            )
            return _driven(unit, model, drive)
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def _driven(unit: object, model: Model, drive: ExportedDrive) -> dict[str, Array]:
    """Return the states (T,) by name of a unit driven step by step."""
    n, m = len(model.states), len(model.inputs)
    states, inputs = list(range(n)), list(range(2 * n, 2 * n + m))
    late = ExportedDrive(drive.t, drive.u, drive.acts + model.delay, drive.x0)
    breaks = np.unique(np.concatenate([drive.t, drive.acts + model.delay]))
    breaks = breaks[(breaks >= drive.t[0]) & (breaks <= drive.t[-1])]
    u = late.input_at(breaks)
    unit.instantiate()  # type: ignore[attr-defined]
    unit.setupExperiment(startTime=float(breaks[0]))  # type: ignore[attr-defined]
    unit.setReal(states, drive.x0.tolist())  # type: ignore[attr-defined]
    unit.enterInitializationMode()  # type: ignore[attr-defined]
    unit.exitInitializationMode()  # type: ignore[attr-defined]
    found = np.empty((breaks.size, n))
    found[0] = drive.x0
    for k, step in enumerate(np.diff(breaks)):
        unit.setReal(inputs, u[k].tolist())  # type: ignore[attr-defined]
        unit.doStep(float(breaks[k]), float(step))  # type: ignore[attr-defined]
        found[k + 1] = unit.getReal(states)  # type: ignore[attr-defined]
    unit.terminate()  # type: ignore[attr-defined]
    unit.freeInstance()  # type: ignore[attr-defined]
    rows = np.searchsorted(breaks, drive.t)
    return {name: found[rows, i] for i, name in enumerate(model.states)}


def _model_header(model: Model, drive: ExportedDrive) -> str:
    """Return model.h: sizes, the values at the start, and the rates."""
    from signlin_ros.export.loss import reference

    n, m = len(model.states), len(model.inputs)
    pars = [c for group in constants(model) for c in group]
    names = [*texts(model, "")[: n + m], *(f"p[{i}]" for i in range(len(pars)))]
    lines, values = written(smooth_rates(model), names, C)
    size = np.abs(reference(model, drive).x).max(axis=0)
    size = np.where(size > 0, size, 1.0)
    start = [*model.x0, *np.zeros(m), *(c.value for c in pars)]
    about = "\n".join(f"   {line}" for line in heading(model, "A model for FMI 2.0, x' = f_j(x, u, p)")).replace(
        "*/", "* /"
    )
    rows = [f"    {line}" for line in (*lines, *(f"f[{i}] = {v};" for i, v in enumerate(values)))]
    quiet = [f"    (void){name};" for name in ("x", "u", "p") if f"{name}[" not in "".join(rows)]
    return "\n".join(
        [
            f"/*\n{about}\n*/",
            f"#define N {n}\n#define M {m}\n#define P {len(pars)}",
            '#define GUID "@GUID@"',
            f"static const double START[N + M + P] = {{{', '.join(number(v) for v in start)}}};",
            f"static const double SIZE[N] = {{{', '.join(number(v) for v in size)}}};",
            "static void rates(const double *x, const double *u, const double *p, double *f)\n{",
            *rows[: len(lines)],
            *quiet,
            *rows[len(lines) :],
            "}\n",
        ]
    )


def _description(model: Model, name: str, guid: str) -> str:
    """Return modelDescription.xml."""
    n, m = len(model.states), len(model.inputs)
    pars = [c for group in constants(model) for c in group]
    known = ranges(model)
    rows = []

    def variable(reference: int, label: str, doc: str, kind: str, real: str) -> None:
        rows.append(
            f'    <ScalarVariable name={quoteattr(label)} valueReference="{reference}" {kind}'
            f" description={quoteattr(doc)}><Real {real}/></ScalarVariable>"
        )

    for i, state in enumerate(model.states):
        real = f'start="{float(model.x0[i])!r}"'
        variable(i, state, model.units[state], 'causality="output" variability="continuous" initial="exact"', real)
    for i, state in enumerate(model.states):
        real = f'derivative="{i + 1}"'
        variable(n + i, f"der({state})", f"{model.units[state]}/s", 'causality="local" variability="continuous"', real)
    for i, label in enumerate(model.inputs):
        variable(2 * n + i, label, model.units[label], 'causality="input" variability="continuous"', 'start="0.0"')
    for i, c in enumerate(pars):
        real = f'start="{c.value!r}"'
        note = constant_note(c)
        if c.public in known:
            note += f"; {known[c.public][0]:.6g} to {known[c.public][1]:.6g} for randomisation"
        variable(2 * n + m + i, c.public, note, 'causality="parameter" variability="fixed" initial="exact"', real)
    outputs = "".join(f'<Unknown index="{i + 1}" dependencies=""/>' for i in range(n))
    derived = "".join(f'<Unknown index="{n + i + 1}"/>' for i in range(n))
    about = quoteattr(f"{model.plant.name}: {model.plant.equation}")
    able = 'canNotUseMemoryManagementFunctions="true" canGetAndSetFMUstate="true" canSerializeFMUstate="true"'
    files = '<SourceFiles><File name="fmi2.c"/></SourceFiles>'
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            f'<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{guid}" description={about}',
            '    generationTool="signlin_ros" variableNamingConvention="flat" numberOfEventIndicators="0">',
            f'  <ModelExchange modelIdentifier="{name}" {able}>{files}</ModelExchange>',
            f'  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true"',
            f"    {able}>{files}</CoSimulation>",
            '  <DefaultExperiment startTime="0.0" tolerance="1e-9"/>',
            "  <ModelVariables>",
            *rows,
            "  </ModelVariables>",
            f"  <ModelStructure><Outputs>{outputs}</Outputs><Derivatives>{derived}</Derivatives>",
            f"  <InitialUnknowns>{derived}</InitialUnknowns></ModelStructure>",
            "</fmiModelDescription>",
            "",
        ]
    )


def _build(root: Path, name: str) -> str:
    """Compile the unit for this machine; returns the platform. Raises `NotRunError` without a compiler."""
    found = PLATFORMS.get(platform.system())
    if found is None or platform.machine().lower() not in ("x86_64", "amd64"):
        raise NotRunError(f"FMI 2.0 has no name for {platform.system()} on {platform.machine()}")
    folder, suffix = found
    binary = root / "binaries" / folder / f"{name}{suffix}"
    binary.parent.mkdir(parents=True)
    build([root / "sources" / "fmi2.c"], binary, ["-ffp-contract=off"])
    return folder


def _pack(root: Path, out: Path) -> None:
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(root.rglob("*")):
            if path.is_file():
                archive.write(path, path.relative_to(root).as_posix())


TARGET = Fmu()

__all__ = ["TARGET", "Fmu"]
