"""MJCF elements of a joint and its actuator, collected before they are written."""

from __future__ import annotations

from dataclasses import dataclass, field

from signlin_ros.export.base import Array

Attributes = dict[str, str]


class LostError(Exception):
    """A law has no element in MJCF; the message says why."""


@dataclass
class MjcfParts:
    """A joint, its actuator, passive elements, and a second inertia.

    ``damping`` are the coefficients of v, v|v| and v³, ``stiffness`` those of x, x² and x³; ``control`` is what a
    control is an input of ours times; ``unheld`` are the keys of effects that have no element; ``needs`` is the oldest
    version of MuJoCo; ``travel`` is the RMS of the position, for stiffnesses that are free.
    """

    hinge: bool
    inertia: float
    travel: float
    speed: float
    damping: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    stiffness: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    frictionloss: float = 0.0
    motor: Attributes = field(default_factory=dict)
    kind: str = "motor"
    passive: list[tuple[str, Attributes]] = field(default_factory=list)
    tendons: list[Attributes] = field(default_factory=list)
    second: tuple[str, float, Attributes] | None = None
    load: Attributes | None = None
    gravity: float = 0.0
    reference: float = 0.0
    delay: float = 0.0
    control: float = 1.0
    bristle: float = 1.0
    bristle_is_free: bool = False
    needs: str = "3.0"
    notes: list[str] = field(default_factory=list)
    holds: list[str] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)
    unheld: list[str] = field(default_factory=list)

    def passively(self, name: str, **attributes: str) -> None:
        """Add a force that is no control's: a motor without inputs, cogging or LuGre friction (MuJoCo 3.12)."""
        self.needs = max(self.needs, "3.12", key=version)
        self.passive.append((name, {**attributes, "motorconst": "0 0", "resistance": "1", "input": "none"}))

    def wave(self, name: str, amplitude: float, order: int, phase: float) -> None:
        """Add amplitude sin(order q + phase), in the motor if it has none yet."""
        text = f"{amplitude!r} {order} {phase!r}"
        if self.kind == "dcmotor" and "cogging" not in self.motor and order > 0:
            self.motor["cogging"] = text
            self.needs = max(self.needs, "3.7", key=version)
        else:
            self.passively(name, cogging=text)

    def bristles(self, name: str, values: tuple[float, float, float, float, float]) -> None:
        """Add LuGre friction: stiffness, damping, Coulomb and static level, Stribeck velocity."""
        text = " ".join(repr(float(v)) for v in values)
        if self.kind == "dcmotor" and "lugre" not in self.motor:
            self.motor["lugre"] = text
            self.needs = max(self.needs, "3.7", key=version)
        else:
            self.passively(name, lugre=text)


def version(text: str) -> tuple[int, ...]:
    """Return a version as numbers."""
    return tuple(int(part) for part in text.split("."))


@dataclass(frozen=True)
class Setting:
    """An integrator and a time step in s."""

    integrator: str
    timestep: float


def body_of(parts: MjcfParts) -> str:
    """Return the body with its joints as XML, a second inertia inside it."""
    kind = "hinge" if parts.hinge else "slide"
    axis = "0 1 0" if parts.load else "0 0 1"
    joint = {"name": "joint", "type": kind, "axis": axis}
    moved = {"pos": "0 0 0", "mass": "1e-9", "diaginertia": "1e-12 1e-12 1e-12"}
    if parts.hinge:
        joint["armature"] = repr(parts.inertia)
    else:  # a slide's friction goes by the mass of its body, whatever its armature: without mass there is none
        moved = {"pos": "0 0 0", "mass": repr(parts.inertia), "diaginertia": "1e-3 1e-3 1e-3"}
    if any(parts.damping):
        joint["damping"] = polynomial(parts.damping)
    if any(parts.stiffness):
        joint["stiffness"] = polynomial(parts.stiffness)
    if parts.frictionloss:
        joint["frictionloss"] = repr(parts.frictionloss)
        joint["solreffriction"] = "0.001 1"
        joint["solimpfriction"] = "0.9999 0.9999 0.001 0.5 2"
    if parts.reference:
        joint["ref"] = repr(parts.reference)
        joint["springref"] = "0"
    inertial = parts.load or moved
    inner = ""
    if parts.second:
        name, inertia, attributes = parts.second
        J = repr(inertia)
        own = {"pos": "0 0 0", "mass": "1e-9" if parts.hinge else J, "diaginertia": f"{J} {J} {J}"}
        more = {"name": "second", "type": kind, "axis": axis, **attributes}
        inner = (
            f'\n      <body name="{name}">\n        {tag("inertial", own)}\n        {tag("joint", more)}\n      </body>'
        )
    return (
        f'    <body name="rotor">\n      {tag("inertial", inertial)}\n      {tag("joint", joint)}{inner}\n    </body>'
    )


def tag(name: str, attributes: Attributes) -> str:
    """Return an element without content."""
    return f"<{name} {' '.join(f'{key}={chr(34)}{value}{chr(34)}' for key, value in attributes.items())}/>"


def polynomial(values: list[float]) -> str:
    """Return coefficients of a polynomial; a single one where that is all."""
    return " ".join(repr(float(v)) for v in (values if any(values[1:]) else values[:1]))


def document(name: str, parts: MjcfParts, setting: Setting, comment: list[str]) -> str:
    """Return the whole MJCF file."""
    actuators = []
    main = {"name": "drive", "joint": "joint", **parts.motor}
    if parts.delay:
        main["delay"] = repr(parts.delay)
        main["nsample"] = str(int(parts.delay / setting.timestep) + 2)
    actuators.append(tag(parts.kind, main))
    actuators += [tag("dcmotor", {"name": key, "joint": "joint", **attributes}) for key, attributes in parts.passive]
    tendons = [
        f"    <fixed {' '.join(f'{k}={chr(34)}{v}{chr(34)}' for k, v in attributes.items())}>"
        f'<joint joint="joint" coef="1"/></fixed>'
        for attributes in parts.tendons
    ]
    down = f"0 0 {-parts.gravity!r}" if parts.gravity else "0 0 0"
    option = {"timestep": repr(setting.timestep), "integrator": setting.integrator, "gravity": down}
    head = "\n".join(f"  {line}" for line in comment).replace("--", "- -")
    return "\n".join(
        [
            "<!--",
            head,
            "-->",
            f'<mujoco model="{name}">',
            '  <compiler angle="radian"/>',
            f"  {tag('option', option)}",
            "  <worldbody>",
            body_of(parts),
            "  </worldbody>",
            *(["  <tendon>", *tendons, "  </tendon>"] if tendons else []),
            "  <actuator>",
            *(f"    {line}" for line in actuators),
            "  </actuator>",
            "</mujoco>",
            "",
        ]
    )


__all__ = ["Array", "LostError", "MjcfParts", "Setting", "document", "version"]
