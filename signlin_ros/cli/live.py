"""The verbs ``signlin ros up`` and ``signlin warm``; argument parsing only."""

from __future__ import annotations

import importlib
import sys

import click

from signlin_ros.errors import InputError, MissingExtraError


@click.group()
def ros() -> None:
    """Nodes of ROS 2 without ROS's launch."""


@ros.command()
@click.argument("models", nargs=-1, required=True, metavar="[NAMESPACE=]MODEL...")
@click.option("--truth", default="", metavar="MODEL", help="What the simulator runs on; default: MODEL.")
@click.option("--record", default="", metavar="DATA", help="A record to replay in place of the simulator.")
@click.option("--real", is_flag=True, help="No simulator: a machine publishes its states.")
@click.option("--namespace", "namespaces", multiple=True, help="Of one joint; repeat it for several on one MODEL.")
@click.option("--without", multiple=True, metavar="NODE", help="A node that is not wanted. Repeatable.")
@click.option(
    "-p", "parameters", multiple=True, metavar="[NAMESPACE/][NODE.]NAME=VALUE", help="A parameter. Repeatable."
)
def up(
    models: tuple[str, ...],
    truth: str,
    record: str,
    real: bool,
    namespaces: tuple[str, ...],
    without: tuple[str, ...],
    parameters: tuple[str, ...],
) -> None:
    """Start simulator or replay, linearizer, monitor and controller on MODEL, until Ctrl-C; each is a process.

    Several joints: a MODEL each with its namespace before it, or one MODEL with several --namespace.
    """
    try:
        live = importlib.import_module("sim_nodes.up")
    except ModuleNotFoundError as error:
        raise MissingExtraError("signlin ros up", "ros") from error
    missing = () if importlib.util.find_spec("signlin_ros.nodes.controller") else ("controller",)
    told = {"truth": truth, "record": record, "simulated": not real, "without": (*without, *missing)}
    plan = live.StartPlan.of(models, namespaces, parameters=parameters, **told)
    for namespace in plan.namespaces:
        plan.names(namespace)
    sys.exit(live.up(plan))


@click.command()
@click.argument("models", nargs=-1, metavar="[MODEL]...")
def warm(models: tuple[str, ...]) -> None:
    """Compile ahead what MODELs need, of a servo every law that is tried on it; by default all shipped ones, and a
    diagnosis. Nothing waits for it later.
    """
    from signlin_ros.model import Model, shipped_models
    from signlin_ros.warming import warm_up

    for name in models or shipped_models():
        try:
            model = Model.load(name)
            seconds = warm_up(model)
            if model.plant.closed_loop:
                from signlin_ros.cli import warming

                seconds += warming.warm_laws(model)
        except InputError as error:
            raise InputError(f"{name}: {error}") from error
        click.echo(f"{name}: {seconds:.1f} s", err=True)
    if not models:
        from signlin_ros.cli import warming

        click.echo(f"a diagnosis: {warming.warm_up():.1f} s", err=True)
