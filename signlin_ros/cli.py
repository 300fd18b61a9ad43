"""The command line ``signlin``: argument parsing only.

Numerics are imported inside the commands, so that ``signlin --help`` answers at once. Every command returns
one plain mapping (JSON Schemas in ``signlin_ros/schemas``) and a text made of it.
"""

from __future__ import annotations

import errno
import json
import math
import os
import shlex
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import click

from signlin_ros import __version__
from signlin_ros.apart import check_given
from signlin_ros.cli_live import ros, warm
from signlin_ros.errors import InputError, MissingExtraError, suggest

METHODS = ("optimal", "termwise", "jacobian")
KINDS = ("exact", "smooth", "piecewise")
Report = tuple[Mapping[str, Any], Callable[[Any], str]]


class _Examples(click.Command):
    """A command whose help ends with examples, lines kept as they are written."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the examples."""
        with formatter.section("Examples"):
            formatter.write_text("\b\n" + (self.epilog or ""))


class _SystemFaultError(Exception):
    """Holds, as its cause, what the system refused a command; what is not held was refused to standard output."""


_OF_THE_PATH = (errno.EACCES, errno.ENAMETOOLONG, errno.ELOOP)
"""What the system refuses for the path that it was given."""


@contextmanager
def _faults_apart() -> Iterator[None]:
    """Tell what goes wrong in a command from what goes wrong when its answer is written."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        if error.filename is not None and error.errno in _OF_THE_PATH:
            raise InputError(f"{error.filename}: {error.strerror}") from error
        raise _SystemFaultError from error


def _json_option(function: Callable[..., Report]) -> Callable[..., None]:
    """Add ``--json`` and print what the command reports, as one JSON object or as text."""

    def run(as_json: bool, **arguments: Any) -> None:
        with _faults_apart():
            content, text = function(**arguments)
            printed = json.dumps(content, indent=2, allow_nan=False) if as_json else text(content)
        click.echo(printed)

    run.__doc__, run.__name__ = function.__doc__, function.__name__
    run.__click_params__ = getattr(function, "__click_params__", [])  # type: ignore[attr-defined]
    return click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else.")(run)


_one_signal = click.option(
    "--signal",
    "signals",
    multiple=True,
    metavar="NAME=COLUMN",
    help="The column of DATA (or /topic.field[...]) that holds a signal of the model, or a formula of columns:"
    " 'speed = meas [rpm]', 'speed = -0.105 * meas', 'voltage = sign(dir) * pwm', 't = time [ms]';"
    " an input may be a number throughout: 'force = 0'."
    " FILE:NAME=COLUMN says it of one record. Repeatable.",
)
_dt_option = click.option(
    "--dt",
    type=float,
    metavar="SECONDS",
    callback=lambda ctx, parameter, value: _step(ctx, value),
    expose_value=False,
    help="DATA has no time: its rows are so many s apart.",
)


def _step(ctx: click.Context, value: float | None) -> None:
    """Keep --dt with the signals, as what the time is."""
    if value is None:
        return
    if not (math.isfinite(value) and value > 0.0):
        raise click.BadParameter(f"{value!r} is not a time in s", param_hint="--dt")
    ctx.meta["signlin.dt"] = value


def _signal_option(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add --signal and --dt, which every verb that reads DATA takes."""
    return _one_signal(_dt_option(function))


def _mapping(signals: Sequence[str], *files: str) -> dict[str, str]:
    """What --signal and --dt say of DATA: name, or FILE:NAME, -> column or formula; ``t`` -> the s from row to row."""
    found = _pairs(signals, "--signal", "NAME=COLUMN")
    check_given(found, files)
    step = click.get_current_context().meta.get("signlin.dt")
    if step is None:
        return found
    if "t" in found:
        raise InputError(f"--dt {step:g} and --signal t={found['t']} both say what the time is; give one")
    return {**found, "t": repr(step)}


_validation_option = click.option(
    "--validation",
    multiple=True,
    metavar="DATA2",
    help="A record that no fit sees. Repeatable; without it the last third of every DATA is held out.",
)
_cure_option = click.option(
    "--cure",
    "cures",
    multiple=True,
    metavar="NAME",
    help="Apply what `signlin check` offers under this name; `none` takes the records as they are. Repeatable.",
)


def _note(text: str) -> None:
    click.echo(text, err=True)


def _progress(text: str) -> None:
    """Say on standard error what takes its time, if somebody is looking."""
    if sys.stderr.isatty():
        _note(text)


# -------------------------------------------------------------------- values


def _pairs(texts: Sequence[str], option: str, form: str) -> dict[str, str]:
    """Return ``name -> text`` from ``NAME=TEXT`` strings, each name once; raise `InputError` otherwise."""
    found: dict[str, str] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            raise InputError(f"{option}: found {text!r}; allowed: {form}")
        if name in found:
            raise InputError(f"{option}: {name} is given twice ({found[name]} and {value})")
        found[name] = value
    return found


def _numbers(texts: Sequence[str], option: str) -> dict[str, float]:
    """Return ``name -> number`` from strings like ``current=0.4,speed=20``; raise `InputError` otherwise."""
    parts = [part for text in texts for part in text.split(",") if part.strip()]
    return {
        name: _number(value, f"{option}: {name}")
        for name, value in _pairs(parts, option, "NAME=NUMBER, several separated by commas").items()
    }


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{where}: found {text!r}; allowed: a number, such as 0.4 or 1e-3") from None
    if not math.isfinite(value):
        raise InputError(f"{where}: found {text!r}; allowed: a finite number")
    return value


def _by_own_name(model: Any, values: Mapping[str, float], option: str, names: Sequence[str]) -> dict[str, float]:
    """Return values by the model's own names; raise `InputError` on a bad or repeated one."""
    own: dict[str, float] = {}
    for name, value in values.items():
        try:
            plain = model.canonical(name)
        except InputError:
            plain = ""
        if plain not in names:
            raise InputError(_unknown(model, name, plain, option, names))
        if plain in own:
            raise InputError(f"{option}: {plain} is given twice, once as {name}")
        own[plain] = value
    return own


def _unknown(model: Any, name: str, plain: str, option: str, names: Sequence[str]) -> str:
    what = "state" if option == "--at" else "input"
    if plain:
        other = f"; {plain} is no {what} of this model" + ("; use --input" if plain in model.inputs else "")
    elif name == "position" and model.plant.position_optional:
        other = "; with_position: true in the model file makes the position a state"
    else:
        other = suggest(name, (*names, "position", "velocity"))
    return f"{option}: unknown {what} {name!r}; there are: {', '.join(names)}{other}"


def _positive(ctx: click.Context, parameter: click.Parameter, value: float) -> float:
    if not 0.0 < value < 1.0:
        raise click.BadParameter(f"{value!r} is not a number between 0 and 1")
    return value


# -------------------------------------------------------------------- commands


@click.group(
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog="Start with: signlin linearize dc_motor --at current=0.4,speed=20",
)
@click.version_option(__version__, prog_name="signlin")
def signlin() -> None:
    """Linear models x' = A x + B u + c of drives with dry friction, backlash and hysteresis.

    MODEL is a ROS 2 parameter file (the one that the linearizer node takes) or the name of a shipped model:
    dc_motor, mass_spring_damper, bouc_wen, force_element, emps, xl330. DATA is a CSV or MAT file or a rosbag2
    recording. Everything is in SI units.

    Exit code 0: done; 2: bad input, with one line that names it; 1: a fault of signlin.
    """


@signlin.command(
    cls=_Examples,
    epilog="""signlin linearize dc_motor --at current=0.4,speed=20
signlin linearize my_motor.yaml --at speed=0.5 --input voltage=2 --method optimal
signlin linearize bouc_wen --at displacement=0.01,velocity=-0.2 --json""",
)
@click.argument("model")
@click.option("--at", "at", multiple=True, metavar="NAME=NUMBER,...", help="The operating point's states.")
@click.option("--input", "inputs", multiple=True, metavar="NAME=NUMBER,...", help="The operating point's inputs.")
@click.option("--method", type=click.Choice(METHODS), help="How to linearize; default: as the model file says.")
@_json_option
def linearize(model: str, at: tuple[str, ...], inputs: tuple[str, ...], method: str | None) -> Report:
    """Print A, B and c of MODEL at an operating point.

    States and inputs that are not named are 0. The linear model is exact at that point: A x + B u + c is
    F(x, u), where F has the smooth sign_j in place of sign. With `operating_point: midpoint` in MODEL the
    point is first carried half an update period forward.
    """
    points = _numbers(at, "--at"), _numbers(inputs, "--input")
    from signlin_ros import console
    from signlin_ros.linearize import Linearizer
    from signlin_ros.model import Model

    loaded = Model.load(model)
    x = loaded.state_vector(_by_own_name(loaded, points[0], "--at", loaded.states))
    u = loaded.input_vector(_by_own_name(loaded, points[1], "--input", loaded.inputs))
    if loaded.operating_point == "midpoint":
        _progress("compiling the model (some seconds the first time) ...")
    result = Linearizer(loaded, method)(x, u)
    for warning in console.linearize_warnings(loaded, result):
        _note(f"warning: {warning}")
    return console.linearize_content(loaded, result), lambda content: console.linearize_text(loaded, content)


@signlin.command(
    cls=_Examples,
    epilog="""signlin simulate dc_motor run.csv -o simulated.csv
signlin simulate dc_motor bag/ -o out.csv --signal voltage=/cmd.data[0]
signlin simulate my_motor.yaml run.csv -o linear.csv --as piecewise""",
)
@click.argument("model")
@click.argument("data")
@click.option("-o", "--output", required=True, metavar="OUT.csv", help="Where to write (.csv or .mcap).")
@click.option(
    "--as",
    "kind",
    type=click.Choice(KINDS),
    default="exact",
    show_default=True,
    help="exact: set-valued friction; smooth: sign_j; piecewise: A, B, c held for each update period.",
)
@click.option("--rtol", default=1e-6, show_default=True, callback=_positive, help="Relative tolerance.")
@_cure_option
@_signal_option
@_json_option
def simulate(
    model: str, data: str, output: str, kind: str, rtol: float, signals: tuple[str, ...], cures: tuple[str, ...]
) -> Report:
    """Drive MODEL with the inputs in DATA and write what it does to OUT.

    The run starts from DATA's first row where that holds every state, else from the model's initial_state.
    Inputs are held between samples. OUT has t, the inputs, the states and the outputs under their plain
    names, at DATA's times: true values, not what the model's sensors show.
    """
    mapping = _mapping(signals, data)
    from signlin_ros import console
    from signlin_ros.checks.run import check as cured
    from signlin_ros.guard import check_files
    from signlin_ros.model import Model
    from signlin_ros.records import SUFFIXES, read_for_model, write_record
    from signlin_ros.simulate import simulate as run

    loaded = Model.load(model)
    check_files(loaded, (data,), output=output, kinds=SUFFIXES)
    record = read_for_model(data, loaded, mapping)
    if cures:
        (record,), _ = cured(loaded, [record], cures)
    _progress(f"simulating {len(record)} samples (the first run of a kind compiles for some seconds) ...")
    start = None if record.x0 is None else loaded.true_states(record.x0)
    result = run(loaded, record.t, record.u, start, kind=kind, rtol=rtol, acts=record.acts)
    write_record(console.trajectory_record(loaded, result, data), output, model=loaded)
    for note in record.notes:
        _note(f"note: {note}")
    return console.simulate_content(loaded, record, result, kind, rtol, output), console.simulate_text


@signlin.command(
    cls=_Examples,
    epilog="""signlin compare my_motor.yaml run.csv
signlin compare emps DATA_EMPS.csv --horizon 0.1 --report emps.html
signlin compare my_servo.yaml monday.csv tuesday.csv --signal displacement=q_meas""",
)
@click.argument("model")
@click.argument("data", nargs=-1, required=True, metavar="DATA...")
@_validation_option
@click.option("--horizon", type=float, help="How far ahead to predict, in s; default: MODEL's update_period.")
@click.option("--cutoff", type=float, help="Low-pass of the effort computed from the motion, in Hz.")
@click.option("--report", metavar="OUT.html", help="Write a report with pictures.")
@_cure_option
@_signal_option
@_json_option
def compare(
    model: str,
    data: tuple[str, ...],
    validation: tuple[str, ...],
    horizon: float | None,
    cutoff: float | None,
    report: str | None,
    signals: tuple[str, ...],
    cures: tuple[str, ...],
) -> Report:
    """Compare MODEL with the measurements in DATA: how good it is, and where it fails.

    First what diagnose, add and refine show of the same files too: the prediction over windows of update_period,
    each from what was measured before it, and the force that is missing, of MODEL as given and with its base
    parameters refitted. Then, of DATA, the free run (simulated from an estimated start), the effort computed from
    the measured motion, what is missing from the equations, and the situations that hold more of the error than
    of the time. --horizon adds the prediction over other windows.
    """
    mapping = _mapping(signals, *data, *validation)
    from signlin_ros import console
    from signlin_ros.checks.finding import to_json
    from signlin_ros.diagnosis.comparison import compare as run
    from signlin_ros.follow.data import load_sides
    from signlin_ros.guard import check_files, check_sides
    from signlin_ros.model import Model

    original = Model.load(model)
    check_files(original, data, validation, report=report)
    loaded, first, second = load_sides(original, data, validation, mapping)
    first, second, findings = check_sides(loaded, first, second, cures)
    records = [*first, *(second or ())]
    _progress(f"comparing {sum(map(len, records))} samples (the first run compiles for some seconds) ...")
    result = run(loaded, first, horizon, cutoff, second, progress=lambda what: _progress(f"  {what}"))
    if report is not None:
        from signlin_ros.report import compare_report

        given = ("compare", model, *data)
        command = _command(given, horizon=horizon, cutoff=cutoff, validation=validation, signal=signals, cure=cures)
        compare_report(result, report, command, findings)
    return {**result.to_json(), "record": to_json(findings)}, console.compare_text


@signlin.command(
    cls=_Examples,
    epilog="""signlin check my_motor.yaml run.csv
signlin check my_motor.yaml bag/ --signal voltage=/cmd.data --json
signlin diagnose my_motor.yaml run.csv --cure speed_in_rpm""",
)
@click.argument("model")
@click.argument("data", nargs=-1, required=True, metavar="DATA...")
@_cure_option
@_signal_option
@_json_option
def check(model: str, data: tuple[str, ...], signals: tuple[str, ...], cures: tuple[str, ...]) -> Report:
    """Look for what is wrong with DATA before anything is concluded from it.

    What cannot do harm is put right and noted; other cures are offered by name, for --cure of this and every other
    verb. What is marked `refuse` stops compare, diagnose, add and refine until it is decided (`--cure none` takes the
    records as they are).
    """
    mapping = _mapping(signals, *data)
    from signlin_ros import console
    from signlin_ros.checks.finding import to_json
    from signlin_ros.checks.run import check as run
    from signlin_ros.follow.data import load_records
    from signlin_ros.guard import check_files
    from signlin_ros.model import Model

    original = Model.load(model)
    check_files(original, data)
    loaded, records = load_records(original, data, mapping)
    _, findings = run(loaded, records, cures)
    return to_json(findings), console.check_text


def _command(words: Sequence[str], **options: Any) -> str:
    """Return a command line; ``options``: by their names, one value or several, those that are empty left out."""
    parts = ["signlin", *words]
    for name, given in options.items():
        values = given if isinstance(given, tuple) else () if given is None else (str(given),)
        for value in values:
            parts += ["-o" if name == "output" else f"--{name}", value]
    return shlex.join(parts)


_output_option = click.option(
    "-o", "--output", required=True, metavar="NEW.yaml", help="The model file to write; not over MODEL."
)


def _diagnosis_options(function: Callable[..., Report]) -> Callable[..., None]:
    """Add what `diagnose`, `add` and `refine` share: MODEL, DATA and the options on them."""
    found: Any = function
    for add_one in (
        _json_option,
        _cure_option,
        _signal_option,
        click.option("--jobs", type=click.IntRange(1, 256), help="Fits side by side; default: one per processor."),
        click.option("--report", metavar="OUT.html", help="Write a report with pictures."),
        _validation_option,
        click.argument("data", nargs=-1, required=True, metavar="DATA..."),
        click.argument("model"),
    ):
        found = add_one(found)
    return cast("Callable[..., None]", found)


@signlin.command(
    cls=_Examples,
    epilog="""signlin diagnose my_motor.yaml monday.csv --validation tuesday.csv
signlin diagnose my_motor.yaml run_1.csv run_2.csv --report diagnosis.html
signlin diagnose my_motor.yaml run.mcap --json > diagnosis.json""",
)
@_diagnosis_options
def diagnose(**options: Any) -> Report:
    """Name the physical effect that MODEL lacks, going by the measurements in DATA, or say that none fits.

    All effects of the catalogue compete, faults of sensors among them; what wins must lower the error on data that
    the fit did not see. The verdict is adequate, missing or unexplained.
    """
    return _diagnosed("diagnose", **options)


@signlin.command(
    cls=_Examples,
    epilog="""signlin add coulomb_friction my_motor.yaml run.csv -o my_motor_2.yaml
signlin add dahl_presliding damper.yaml a.csv --validation b.csv -o damper_2.yaml
signlin add learned_force drive.yaml a.csv --over speed -o drive_2.yaml""",
)
@click.argument("effect")
@click.option("--over", metavar="WHAT", help="For learned_force: speed, position, load, or two of them: speed,load.")
@_output_option
@_diagnosis_options
def add(over: str | None, **options: Any) -> Report:
    """Add EFFECT to MODEL, fit it to DATA and write NEW.yaml: before and after, on data that the fit did not see.

    The effect learned_force is a curve that is learned from what inverse dynamics leaves, where nothing listed fits.
    """
    if options["effect"] == "learned_force":
        return _learned(over or "speed", **options)
    if over is not None:
        raise InputError("--over: only learned_force is learned over a coordinate")
    return _diagnosed("add", **options)


def _learned(
    over: str,
    effect: str,
    model: str,
    data: tuple[str, ...],
    validation: tuple[str, ...],
    report: str | None,
    output: str,
    signals: tuple[str, ...],
    jobs: int | None = None,
    cures: tuple[str, ...] = (),
) -> Report:
    if report is not None:
        raise InputError("--report: add learned_force draws none; use signlin compare NEW.yaml DATA --report OUT.html")
    mapping = _mapping(signals, *data, *validation)
    from signlin_ros import console
    from signlin_ros.checks.finding import to_json
    from signlin_ros.follow.data import load_sides
    from signlin_ros.guard import check_files, check_sides
    from signlin_ros.learned import add_learned
    from signlin_ros.model import SUFFIXES, Model

    original = Model.load(model)
    check_files(original, data, validation, output, SUFFIXES)
    loaded, first, second = load_sides(original, data, validation, mapping)
    first, second, findings = check_sides(loaded, first, second, cures)
    _progress(f"{effect}: {sum(map(len, [*first, *(second or ())]))} samples ...")
    new, content = add_learned(loaded, first, second, over)
    new = new.with_options(with_position=original.with_position)
    new.save(output)
    text = new.placed_in(Path(output).parent).to_yaml()
    return {**content, "model": text, "record": to_json(findings)}, console.diagnosis_text


@signlin.command(
    cls=_Examples,
    epilog="""signlin refine my_motor.yaml run.csv -o my_motor_2.yaml
ros2 run signlin_ros linearizer --ros-args --params-file my_motor_2.yaml""",
)
@_output_option
@_diagnosis_options
def refine(**options: Any) -> Report:
    """Diagnose MODEL and add what is missing until nothing confirmed is; writes NEW.yaml and says why it stopped."""
    return _diagnosed("refine", **options)


def _diagnosed(
    verb: str,
    model: str,
    data: tuple[str, ...],
    validation: tuple[str, ...],
    report: str | None,
    jobs: int | None,
    signals: tuple[str, ...],
    cures: tuple[str, ...],
    output: str | None = None,
    effect: str | None = None,
) -> Report:
    mapping = _mapping(signals, *data, *validation)
    from signlin_ros import console
    from signlin_ros.checks.finding import to_json
    from signlin_ros.diagnosis import verbs as page
    from signlin_ros.diagnosis.proposal import printed
    from signlin_ros.files import write_text
    from signlin_ros.follow.data import load_sides
    from signlin_ros.guard import check_files, check_sides
    from signlin_ros.model import SUFFIXES, Model

    original = Model.load(model)
    check_files(original, data, validation, output, SUFFIXES, report)
    loaded, first, second = load_sides(original, data, validation, mapping)
    first, second, findings = check_sides(loaded, first, second, cures)
    records = [*first, *(second or ())]
    _progress(f"{verb}: {sum(map(len, records))} samples (the first run on a machine compiles for some seconds) ...")
    arguments = (*([effect] if effect else []), loaded, first, second)
    result = getattr(page, verb)(*arguments, jobs=jobs or os.cpu_count() or 1, progress=_stage)
    result = printed(result, original, output, records)
    if output is not None:
        try:
            write_text(output, result.yaml)
        except OSError as error:
            raise InputError(f"-o: cannot write {output}: {error.strerror}") from error
    if report is not None:
        from signlin_ros.report import diagnosis_report

        words = (verb, *([effect] if effect else []), model, *data)
        command = _command(words, validation=validation, signal=signals, cure=cures, output=output)
        diagnosis_report(result, report, command=command, data=(first, second), model=loaded, record=findings)
    return {**result.to_json(), "record": to_json(findings)}, console.diagnosis_text


def _stage(what: str, share: float) -> None:
    _progress(f"  {100 * share:3.0f} %  {what}")


@signlin.command(
    cls=_Examples,
    epilog="""signlin effects
signlin effects stribeck_friction
signlin effects my_effect --model my_motor.yaml
signlin effects --json""",
)
@click.argument("name", required=False)
@click.option("--model", metavar="MODEL", help="A model whose own effects (effect_files) are shown too.")
@_json_option
def effects(name: str | None, model: str | None) -> Report:
    """List the physical effects that a model may hold, or show the effect NAME.

    Laws, parameters with units and bounds, the plants that each applies to, and the sources.
    """
    from signlin_ros import catalogue, console

    return {"effects": catalogue.effects(name, model)}, console.effect_text if name else console.effects_text


@signlin.command(
    cls=_Examples,
    epilog="""signlin plants
signlin plants dc_motor
signlin plants --json""",
)
@click.argument("name", required=False)
@_json_option
def plants(name: str | None) -> Report:
    """List the plants (base equations), or show the plant NAME.

    Equations, states, inputs and outputs with their units, and the parameters.
    """
    from signlin_ros import catalogue, console

    return {"plants": catalogue.plants(name)}, console.plant_text if name else console.plants_text


@signlin.command(
    cls=_Examples,
    epilog="""signlin gains dc_motor
signlin gains my_motor.yaml --at speed=2 --bandwidth 20
signlin gains my_servo.yaml --period 0.005 --speed 3 --limit 12 --json""",
)
@click.argument("model")
@click.option("--at", "at", multiple=True, metavar="NAME=NUMBER,...", help="The operating point's states.")
@click.option("--period", type=float, default=0.02, show_default=True, help="Time between updates in s.")
@click.option("--delay", type=float, help="From a sample until its input acts, in s; default: one period.")
@click.option("--speed", type=float, help="Largest speed of the references; default: what the model is made for.")
@click.option("--limit", type=float, help="Largest |input|; default: where MODEL's input saturates, else none.")
@click.option("--bandwidth", type=float, help="Of the feedback in rad/s; default: what the delay leaves room for.")
@_json_option
def gains(model: str, at: tuple[str, ...], **numbers: float | None) -> Report:
    """Print the gains and constants that an engineer sets for MODEL, and what each effect is worth to them.

    Feed-forward constants, LQR gains with integral action at a speed loop and a position loop, PI(D) gains from
    the same weights, what A_k says at operating points, and the tracking error that simulation predicts with and
    without each effect.
    """
    point = _numbers(at, "--at")
    for name, value in numbers.items():
        if value is not None and not (0.0 < value < math.inf or (name == "delay" and value == 0.0)):
            raise InputError(f"--{name}: found {value:g}; allowed: a positive number")
    from signlin_ros.control.gains import Wishes, gains_content
    from signlin_ros.control.text import gains_text
    from signlin_ros.model import Model

    loaded = Model.load(model)
    own = _by_own_name(loaded, point, "--at", loaded.states)
    _progress("designing and simulating (the first run on a machine compiles for some seconds) ...")
    return gains_content(loaded, own, Wishes(**cast("dict[str, Any]", numbers))), gains_text


@signlin.command(cls=_Examples, epilog="signlin figures -o out")
@click.option("-o", "--output", required=True, metavar="DIR", help="The folder to write to; it is made if need be.")
@_json_option
def figures(output: str) -> Report:
    """Redraw figures 1 to 6 of the paper, and what goes beyond them; numbers beside 4 and 5."""
    from signlin_ros.figures import make_figures
    from signlin_ros.files import refusal

    folder = Path(output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"-o: {output}: {error.strerror}") from error
    why = refusal(folder / "figure_1.png")
    if why:
        raise InputError(f"-o: {output}: {why}")
    _progress("drawing ...")
    return {"directory": str(folder), "files": make_figures(folder)["files"]}, lambda content: "\n".join(
        content["files"]
    )


@signlin.command(
    cls=_Examples,
    epilog="""signlin workbench
signlin workbench my_motor.yaml monday.csv tuesday.csv
signlin workbench my_motor.yaml --namespace /arm --joint elbow
signlin workbench --host 0.0.0.0 --port 8080""",
)
@click.argument("model", required=False)
@click.argument("data", nargs=-1, metavar="[DATA...]")
@click.option(
    "--host", help="Listen on another address than 127.0.0.1; whoever opens the page needs the token printed."
)
@click.option("--port", default=0, type=click.IntRange(0, 65535), help="Default: any that is free.")
@click.option("--no-browser", is_flag=True, help="Only print the address.")
@click.option("--sample", is_flag=True, help="Begin with the sample record.")
@click.option("--namespace", default="", help="ROS namespace of the nodes that the tab Live follows.")
@click.option("--joint", default="joint", show_default=True, help="Which joint of joint_states it follows.")
def workbench(
    model: str | None,
    data: tuple[str, ...],
    host: str | None,
    port: int,
    no_browser: bool,
    sample: bool,
    namespace: str,
    joint: str,
) -> None:
    """Open a page on this machine on which records are compared, diagnosed and explained by clicking.

    What is done there is kept in the folder .signlin; every click shows the command that does the same.
    """
    try:
        from signlin_ros.workbench.server import serve
    except ModuleNotFoundError as error:
        if (error.name or "signlin_ros").startswith("signlin_ros"):
            raise
        raise MissingExtraError("The workbench", "web") from error
    live = (f"--namespace={namespace}", f"--joint={joint}")
    serve((model, *data) if model else (), host, port, show=not no_browser, sample=sample, live=live)


# -------------------------------------------------------------------- running


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())


def _usage(error: click.UsageError) -> str:
    where = f" (see: {error.ctx.command_path} --help)" if error.ctx else ""
    return " ".join(error.format_message().split()) + where


def _fault(error: Exception) -> int:
    """Report a fault of ours; the traceback only where it was asked for."""
    if os.environ.get("SIGNLIN_DEBUG", "") not in ("", "0"):
        raise error
    _note(
        f"signlin: {type(error).__name__}: {_one_line(error)}; this is a fault of signlin: please report it"
        " with the command and its files (SIGNLIN_DEBUG=1 shows where)"
    )
    return 1


def _drop_output() -> None:
    """Let what is still to be written to standard output go nowhere, if it can be written nowhere else."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _run(arguments: Sequence[str] | None) -> int:
    """Run a command; what overflows on the way is no news: where it matters, the result or the error says so."""
    with warnings.catch_warnings():
        if not sys.warnoptions:
            warnings.simplefilter("ignore", RuntimeWarning)
        given = None if arguments is None else list(arguments)
        code = signlin.main(args=given, prog_name="signlin", standalone_mode=False)
    return code if isinstance(code, int) else 0


for _live in (ros, warm):
    signlin.add_command(_live)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code: 0 done, 2 bad input, 1 a fault of ours."""
    try:
        return _run(arguments)
    except click.exceptions.NoArgsIsHelpError as error:
        _note(error.format_message())
        return 2
    except click.UsageError as error:
        _note(f"signlin: {_usage(error)}")
        return 2
    except (InputError, MissingExtraError) as error:
        _note(f"signlin: {_one_line(error)}")
        return 2
    except (click.Abort, KeyboardInterrupt):
        _note("signlin: interrupted")
        return 130
    except BrokenPipeError:
        _drop_output()  # nobody reads on: `signlin effects | head`
        return 0
    except OSError as error:
        _drop_output()  # what did not fit on a full disk is not tried again at the end
        _note(f"signlin: writing the output: {error.strerror or error}")
        return 2
    except _SystemFaultError as error:
        return _fault(cast("Exception", error.__cause__))
    except Exception as error:  # noqa: BLE001 - the last resort, so that nobody meets a traceback
        return _fault(error)


if __name__ == "__main__":
    sys.exit(main())
