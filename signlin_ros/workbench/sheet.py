"""A model file from the numbers of a data sheet: forms with fields, units and bounds, and the model that they make."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from signlin_ros import units
from signlin_ros.errors import InputError, choices
from signlin_ros.model import Model
from signlin_ros.plants import find_plant

TOLERANCE = 0.2
"""How far the numbers of a data sheet, and of a load that was estimated, may be off."""


@dataclass(frozen=True)
class Field:
    """A number of a form: which parameters it is, its name, units in which it may be given, where it starts."""

    parameters: tuple[str, ...]
    label: str
    doc: str
    units: tuple[str, ...]
    start: float


@dataclass(frozen=True)
class Form:
    """What a form makes: a plant, with options of the model file."""

    title: str
    plant: str
    fields: tuple[Field, ...]
    options: Mapping[str, Any]


MOTOR_FIELDS = (
    Field(("R_a",), "R", "resistance of the winding", ("Ohm", "mOhm"), 1.0),
    Field(("L_a",), "L", "its inductance; 0 where it does not matter", ("mH", "uH", "H"), 1.0),
    Field(("K_t", "K_m"), "K", "torque constant, which is the back-EMF constant", ("mN·m/A", "N·m/A", "V/krpm"), 50.0),
    Field(("J",), "J", "inertia of rotor and load", ("g·cm²", "kg·cm²", "kg·m²"), 100.0),
    Field(("B",), "B", "viscous friction, if known", ("N·m·s/rad", "mN·m·s/rad"), 0.0),
)
SLIDE = (
    Field(("m",), "mass", "what moves", ("kg", "g"), 1.0),
    Field(("k",), "stiffness", "0: a free drive", ("N/m", "N/mm"), 0.0),
    Field(("c",), "damping", "if known", ("N·s/m", "N·s/mm"), 0.1),
)
TURNING_FIELDS = (
    Field(("m",), "inertia", "what turns", ("kg·m²", "kg·cm²", "g·cm²"), 0.01),
    Field(("k",), "stiffness", "0: a free drive", ("N·m/rad",), 0.0),
    Field(("c",), "damping", "if known", ("N·m·s/rad", "mN·m·s/rad"), 0.01),
)
FORMS = {
    "motor": Form("Motor: voltage drives it", "dc_motor", MOTOR_FIELDS, {}),
    "slide": Form("Mass, stiffness, damping: a force drives it", "mass_spring_damper", SLIDE, {"axis": "linear"}),
    "turn": Form(
        "Inertia, stiffness, damping: a torque drives it", "mass_spring_damper", TURNING_FIELDS, {"axis": "rotary"}
    ),
}


ROTARY = {"m": "kg·m²", "c": "N·m·s/rad", "k": "N·m/rad"}
"""Units of what turns, of parameters that are declared for what slides."""


def forms() -> list[dict[str, Any]]:
    """Return the forms as the page shows them."""
    return [
        {
            "id": name,
            "title": form.title,
            "fields": [
                {"name": f.label, "doc": f.doc, "units": list(f.units), "start": f.start, "least": _least(form, f)}
                for f in form.fields
            ],
        }
        for name, form in FORMS.items()
    ]


def _least(form: Form, field: Field) -> str:
    positive = find_plant(form.plant, "plant").pars()[field.parameters[0]].positive
    return "more than 0" if positive else "0 or more"


def model_of(name: str, values: Mapping[str, Any]) -> Model:
    """Return the model of a form; ``values``: number and unit by field. Raises `InputError` naming the field."""
    if name not in FORMS:
        raise InputError(f"no such form: {name!r}; there are: {choices(FORMS)}")
    form = FORMS[name]
    numbers = {p: _number(f, values.get(f.label), p, form) for f in form.fields for p in f.parameters}
    content = {"plant": form.plant, "parameters": numbers, "tolerance": TOLERANCE, **form.options}
    return Model.from_dict(content, "the form")


def _number(field: Field, given: Any, parameter: str, form: Form) -> float:
    """Return a value in the unit of a parameter."""
    try:
        number, unit = float(str(given[0]).replace(",", ".")), str(given[1])
    except (TypeError, ValueError, IndexError, KeyError) as error:
        raise InputError(f"{field.label}: {field.doc}: give a number") from error
    if unit not in field.units:
        raise InputError(f"{field.label}: found the unit {unit!r}; allowed: {', '.join(field.units)}")
    par = find_plant(form.plant, "plant").pars()[parameter]
    wanted = ROTARY[parameter] if form.options.get("axis") == "rotary" else par.unit
    if parameter in ("K_t", "K_m"):  # one number in SI units
        wanted = "N·m/A" if units.conversion(unit, "N·m/A") else "V·s/rad"
    how = units.conversion(unit, wanted)
    if how is None:
        raise InputError(f"{field.label}: {unit!r} is no unit of it")
    return float(f"{par.check(number * how[0], field.label):.9g}")


__all__ = ["forms", "model_of"]
