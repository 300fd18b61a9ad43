"""The commands ``effects`` and ``plants``: what a model may be made of."""

from __future__ import annotations

import click

from signlin_ros.cli.options import Examples, Report, json_option


@click.command(
    cls=Examples,
    epilog="""signlin effects
signlin effects stribeck_friction
signlin effects my_effect --model my_motor.yaml
signlin effects --json""",
)
@click.argument("name", required=False)
@click.option("--model", metavar="MODEL", help="A model whose own effects (effect_files) are shown too.")
@json_option
def effects(name: str | None, model: str | None) -> Report:
    """List the physical effects that a model may hold, or show the effect NAME.

    Laws, parameters with units and bounds, the plants that each applies to, and the sources.
    """
    from signlin_ros import console
    from signlin_ros.console import catalogue

    return {"effects": catalogue.effects(name, model)}, console.effect_text if name else console.effects_text


@click.command(
    cls=Examples,
    epilog="""signlin plants
signlin plants dc_motor
signlin plants --json""",
)
@click.argument("name", required=False)
@json_option
def plants(name: str | None) -> Report:
    """List the plants (base equations), or show the plant NAME.

    Equations, states, inputs and outputs with their units, and the parameters.
    """
    from signlin_ros import console
    from signlin_ros.console import catalogue

    return {"plants": catalogue.plants(name)}, console.plant_text if name else console.plants_text


__all__ = ["effects", "plants"]
