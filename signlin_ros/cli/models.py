"""The commands ``linearize``, ``simulate`` and ``gains``: what a model says and does."""

from __future__ import annotations

import math
from typing import Any, cast

import click

from signlin_ros.cli.arms import gains_of, is_arm
from signlin_ros.cli.options import Examples, Report, cure_option, json_option, mapping_of, signal_option
from signlin_ros.cli.telling import progress, tell
from signlin_ros.cli.values import by_own_name, numbers_of, positive
from signlin_ros.control import CONTROL_PERIOD
from signlin_ros.errors import InputError

METHOD_CHOICES = ("optimal", "termwise", "jacobian", "per_joint")
KINDS = ("exact", "smooth", "piecewise")


@click.command(
    cls=Examples,
    epilog="""signlin linearize dc_motor --at current=0.4,speed=20
signlin linearize my_motor.yaml --at speed=0.5 --input voltage=2 --method optimal
signlin linearize bouc_wen --at displacement=0.01,velocity=-0.2 --json""",
)
@click.argument("model")
@click.option("--at", "at", multiple=True, metavar="NAME=NUMBER,...", help="The operating point's states.")
@click.option("--input", "inputs", multiple=True, metavar="NAME=NUMBER,...", help="The operating point's inputs.")
@click.option("--method", type=click.Choice(METHOD_CHOICES), help="How to linearize; default: as the model file says.")
@json_option
def linearize(model: str, at: tuple[str, ...], inputs: tuple[str, ...], method: str | None) -> Report:
    """Print A, B and c of MODEL at an operating point.

    States and inputs that are not named are 0. The linear model is exact at that point: A x + B u + c is
    F(x, u), where F has the smooth sign_j in place of sign. With `operating_point: midpoint` in MODEL the
    point is first carried half an update period forward.
    """
    points = numbers_of(at, "--at"), numbers_of(inputs, "--input")
    from signlin_ros import console
    from signlin_ros.linearization import Linearizer
    from signlin_ros.model import Model

    loaded = Model.load(model)
    x = loaded.state_vector(by_own_name(loaded, points[0], "--at", loaded.states))
    u = loaded.input_vector(by_own_name(loaded, points[1], "--input", loaded.inputs))
    if loaded.operating_point == "midpoint":
        progress("compiling the model (some seconds the first time) ...")
    result = Linearizer(loaded, method)(x, u)
    for warning in console.linearize_warnings(loaded, result):
        tell(f"warning: {warning}")
    return console.linearize_content(loaded, result), lambda content: console.linearize_text(loaded, content)


@click.command(
    cls=Examples,
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
@click.option("--rtol", default=1e-6, show_default=True, callback=positive, help="Relative tolerance.")
@cure_option
@signal_option
@json_option
def simulate(
    model: str, data: str, output: str, kind: str, rtol: float, signals: tuple[str, ...], cures: tuple[str, ...]
) -> Report:
    """Drive MODEL with the inputs in DATA and write what it does to OUT.

    The run starts from DATA's first row where that holds every state, else from the model's initial_state.
    Inputs act between samples as MODEL's input_hold says; with auto they are held. OUT has t, the inputs, the
    states and the outputs under their plain names, at DATA's times: true values, not what the sensors show.
    """
    mapping = mapping_of(signals, data)
    from signlin_ros import console
    from signlin_ros.checks.run import check as cured
    from signlin_ros.guard import check_files
    from signlin_ros.model import Model
    from signlin_ros.records import RECORD_SUFFIXES, read_for_model, write_record
    from signlin_ros.simulation import simulate as run

    loaded = Model.load(model)
    check_files(loaded, (data,), output=output, kinds=RECORD_SUFFIXES)
    record = read_for_model(data, loaded, mapping)
    if cures:
        (record,), _ = cured(loaded, [record], cures)
    progress(f"simulating {len(record)} samples (the first run of a kind compiles for some seconds) ...")
    start = None if record.x0 is None else loaded.true_states(record.x0)
    if start is None and loaded.plant.closed_loop:  # it goes on from what was measured, at rest
        first = {n: float(v[0]) for n, v in record.measured.items() if n in loaded.states and math.isfinite(v[0])}
        start = loaded.true_states(loaded.state_vector({**loaded.initial_state, **first}))
    loaded = loaded.under(record.conditions)
    result = run(loaded, record.t, record.u, start, kind=kind, rtol=rtol, acts=record.acts)
    write_record(console.trajectory_record(loaded, result, data), output, model=loaded)
    for note in record.notes:
        tell(f"note: {note}")
    return console.simulate_content(loaded, record, result, kind, rtol, output), console.simulate_text


@click.command(
    cls=Examples,
    epilog="""signlin gains dc_motor
signlin gains my_motor.yaml --at speed=2 --bandwidth 20
signlin gains my_servo.yaml --period 0.005 --speed 3 --limit 12 --json""",
)
@click.argument("model")
@click.option("--at", "at", multiple=True, metavar="NAME=NUMBER,...", help="The operating point's states.")
@click.option("--period", type=float, default=CONTROL_PERIOD, show_default=True, help="Time between updates in s.")
@click.option("--delay", type=float, help="From a sample until its input acts, in s; default: one period.")
@click.option("--speed", type=float, help="Largest speed of the references; default: what the model is made for.")
@click.option("--limit", type=float, help="Largest |input|; default: where MODEL's input saturates, else none.")
@click.option("--bandwidth", type=float, help="Of the feedback in rad/s; default: what the delay leaves room for.")
@json_option
def gains(model: str, at: tuple[str, ...], **numbers: float | None) -> Report:
    """Print the gains and constants that an engineer sets for MODEL, and what each effect is worth to them.

    Feed-forward constants, LQR gains with integral action at a speed loop and a position loop, PI(D) gains from
    the same weights, what A_k says at operating points, and the tracking error that simulation predicts with and
    without each effect.
    """
    point = numbers_of(at, "--at")
    for name, value in numbers.items():
        if value is not None and not (0.0 < value < math.inf or (name == "delay" and value == 0.0)):
            raise InputError(f"--{name}: found {value:g}; allowed: a positive number")
    from signlin_ros.control.gains import Wishes, gains_content
    from signlin_ros.control.text import gains_text
    from signlin_ros.model import Model

    loaded = Model.load(model)
    own = by_own_name(loaded, point, "--at", loaded.states)
    if is_arm(loaded):
        return gains_of(loaded, own, numbers)
    progress("designing and simulating (the first run on a machine compiles for some seconds) ...")
    return gains_content(loaded, own, Wishes(**cast("dict[str, Any]", numbers))), gains_text


__all__ = ["KINDS", "METHOD_CHOICES", "gains", "linearize", "simulate"]
