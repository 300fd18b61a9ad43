"""What a physical effect is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Any, ClassVar

from signlin_ros.digits import with_error
from signlin_ros.errors import joined
from signlin_ros.names import printed_name
from signlin_ros.par import HasPars, Pars, declared_name, gathered, place_of
from signlin_ros.scale import Scale
from signlin_ros.sensors import Sensor

CHANNEL_UNIT = "of the channel"
"""Declared unit of what a `SensorEffect` has in the unit of the channel that it is on."""
COORDINATE_UNIT = "of the coordinate"
"""Declared unit of what is in the unit of a coordinate that another parameter names."""
DOUBTFUL = 1 / 3
"""A value is told with its standard error where that is a larger share of it."""


class Shown(float):
    """A number that knows its unit, for the templates of `Effect.finding`; a doubtful one shows its standard error."""

    unit: str
    std: float | None

    def __new__(cls, value: float, unit: str, std: float | None = None) -> Shown:
        shown = super().__new__(cls, value)
        shown.unit, shown.std = unit, std
        return shown

    def __format__(self, spec: str) -> str:
        value, error = with_error(float(self), self.std)
        doubtful = error and self.std is not None and self.std > DOUBTFUL * abs(self)
        return f"{value} ± {error}" if doubtful else super().__format__(spec)


class Effect(HasPars):
    """One physical effect: declarations, and pure functions of the model's coordinates.

    Parameters are class attributes of type `signlin_ros.par.Par`; a list is a tuple to the law. The methods take the
    vocabulary ``m`` (`signlin_ros.mathops`), the coordinates ``x`` and the parameters ``p``, and return expressions:

    ``x.velocity``, ``x.position``   of the moving mass; a motor has a position if an effect asks for it
    ``x.drive_force``                K_t i, or the input force
    ``x.external_force``             gravity, constant load and stiffness of the model, summed
    ``x.temperature``                in K; an input of the model if an effect asks for it, so a record must hold it
    ``x.own.z``                      the effect's own state ``z``

    Force or torque acts on the moving mass; positive accelerates. Override what the effect does; the rest is
    neutral.
    """

    name: ClassVar[str]
    """The name in model files."""
    equation: ClassVar[str]
    """The law as text, as in the catalogue."""
    finding: ClassVar[str] = ""
    """What a record shows where this is missing, as a sentence: ``{mu:.3g}`` a parameter's value, with its standard
    error where it is doubtful, ``{mu.unit}`` its unit, ``{F}``, ``{Q}``, ``{V}`` the plant's words for force, position
    and velocity. Empty: see `shown`.
    """
    experiment: ClassVar[str] = ""
    """What to record so that it shows, as an imperative clause."""
    command: ClassVar[str] = ""
    """The family of planned commands that does so, by its name in `signlin_ros.experiment.families`."""
    only_beyond: ClassVar[bool] = False
    """Whether it acts only beyond a limit, so that no record excludes it outside of what it visits."""
    states: ClassVar[dict[str, str]] = {}
    """Own states and their units (``F`` and ``Q`` as in `Par`)."""
    plants: ClassVar[tuple[str, ...]] = ()
    """Plants that it applies to; empty: all."""
    external: ClassVar[bool] = False
    """Whether its force counts as an external force that loads bearings and gears."""
    family: ClassVar[str] = ""
    """Laws of one family are richer and simpler forms of one thing: a model has one of them, the simplest that suffices
    unless a richer one is surely better."""
    contains: ClassVar[tuple[str, ...]] = ()
    """Simpler effects that it is for some values of its parameters."""
    dissipative: ClassVar[bool] = False
    """Whether v F <= 0 always (checked by the contract tests)."""

    start: ClassVar[tuple[Mapping[str, float], ...]] = ()
    """Where a fit starts from, in multiples of the record's `Scale`; empty: 0.05 of each."""
    held: ClassVar[Mapping[str, float | None]] = {}
    """Parameters that no record tells from the others, and what a fit holds them at (None: at the start)."""
    within: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Bounds that a fit keeps to, where a model file may go beyond."""
    angular: ClassVar[bool] = False
    """Whether its force is periodic in the position, so that it matters where exactly a record starts."""
    rugged: ClassVar[bool] = False
    """Whether a fit has many local minima: ``starts`` are many then, all parameters positive, and the best are bred."""
    resonant: ClassVar[bool] = False
    """Whether it starts from resonances all over the band, of which none leads to another."""
    essential: ClassVar[tuple[str, ...]] = ()
    """Parameters that make it what it is: a fit without one of them must be clearly worse."""
    neutral: ClassVar[Mapping[str, float]] = {}
    """Values of parameters at which the effect does nothing, where these are not 0."""
    telling: ClassVar[tuple[str, ...]] = ()
    """Parameters that tell it from simpler effects: each must be known to better than its own size."""
    together: ClassVar[tuple[str, ...]] = ()
    """Parameters without all of which it is a simpler effect: together they must differ from nothing."""
    floating: ClassVar[bool] = False
    """Whether its own states run away from where they should be (a load that is free in its play), so that an observer
    must correct them."""
    load_inertia: ClassVar[str] = ""
    """Parameter that is an inertia behind a coupling: the nominal inertia of the plant may be that of both."""
    turning: ClassVar[tuple[str, str] | tuple[()]] = ()
    """(amplitude, phase) of a force that is the same with the amplitude's sign changed and half a turn more."""
    periodic: ClassVar[tuple[str, ...]] = ()
    """(order, amplitude, phase) of a force -amplitude sin(order q + phase), whose order is scanned for."""
    several: ClassVar[tuple[str, ...]] = ()
    """The same of lists: a sum of such forces, found wave by wave."""
    whole_orders: ClassVar[tuple[str, ...]] = ()
    """Parameters that are periods a turn, and so whole numbers, where the axis is rotary."""
    proposed: ClassVar[bool] = True
    """Whether a diagnosis tries it by itself; else only who asks for it adds it."""

    @classmethod
    def starts(cls, scale: Scale) -> list[dict[str, float]]:
        """Return the points from which a fit to a record of this scale starts."""
        pars = cls.pars()
        multiples = cls.start or (dict.fromkeys(pars, 0.05),)
        return [{name: value * scale.of(pars[name].unit) for name, value in one.items()} for one in multiples]

    @classmethod
    def shown(cls, values: Mapping[str, Shown], F: str, Q: str, V: str) -> str:
        """Return the sentence on what a record shows: `finding`, or one made of the name and the parameters."""
        if cls.finding:
            return cls.finding.format(F=F, Q=Q, V=V, **gathered(values))
        name = printed_name(cls.name)
        what = f"the residual {F} has the shape of {name}" if cls.force is not Effect.force else f"it shows {name}"
        listed = [f"{n} = {v:.3g}" + (f" {v.unit}" if v.unit not in ("", "-") else "") for n, v in values.items()]
        return f"{what}, with {joined(listed)}" if listed else what

    @classmethod
    def after(cls, simple: str, p: Mapping[str, float]) -> list[dict[str, float]]:
        """Return more points to start from, given the parameters that a simpler effect was fitted with."""
        return []

    @classmethod
    def order_names(cls) -> tuple[str, ...]:
        """Return the names under which orders of waves over the position are declared."""
        return (*cls.periodic[:1], *cls.several[:1])

    @classmethod
    def waves(cls, p: Mapping[str, float]) -> list[tuple[float, float, float]]:
        """Return (order, amplitude, phase) of the waves over the position that it is the sum of; none of another."""
        if cls.several:
            numbers = [place_of(n) for n in p if declared_name(n) == cls.several[0]]
            names = [[f"{n}[{i}]" for n in cls.several] for i in numbers]
        else:
            names = [list(cls.periodic)] if cls.periodic else []
        return [(p[order], p[amplitude], p[phase]) for order, amplitude, phase in names]

    @classmethod
    def of_waves(cls, waves: Sequence[tuple[float, float, float]]) -> dict[str, float]:
        """Return its parameters for waves (order, amplitude, phase)."""
        return {f"{n}[{i}]": x for i, wave in enumerate(waves) for n, x in zip(cls.several, wave, strict=True)}

    @classmethod
    def holding(cls, simple: str, p: Mapping[str, float]) -> dict[str, float]:
        """Return its own parameters, by name, for those of a simpler effect that it contains; empty: no relation."""
        return {}

    @classmethod
    def nearby(cls, p: Mapping[str, float]) -> list[dict[str, float]]:
        """Return points that a fit which ended with these parameters goes on from too: other minima are often there."""
        return []

    @classmethod
    def instead(cls, others: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
        """Return with which parameters this effect alone is about what several others are together, by their names and
        parameters; nothing if it is not.
        """
        return {}

    @classmethod
    def simpler(cls, p: Mapping[str, float]) -> dict[str, dict[str, float]]:
        """Return the simpler effects that this one nearly is for these parameters, and theirs."""
        return {}

    @classmethod
    def of_interest(cls, p: Mapping[str, float], scale: Scale) -> dict[str, tuple[float, float]]:
        """Return the least and the largest values of parameters between which it is of interest beside the simpler laws
        that it contains, which else could never win; the size that is told first; infinite where free. Empty: any value
        is. ``p``: its parameters, ``scale``: of the record.
        """
        return {}

    @classmethod
    def fault(cls, p: Any) -> str:
        """Return the error of parameters that are each within their bounds, starting with the name of one of
        them (``knots: found ...; allowed: ...``); empty: nothing. ``p`` as the law gets it.
        """
        return ""

    @classmethod
    def plausible(cls, p: Mapping[str, float]) -> bool:
        """Tell whether fitted parameters are those of the effect, and not of something that its equation imitates."""
        return True

    @classmethod
    def free_within(cls, p: Mapping[str, float]) -> float:
        """Return the distance from position zero within which it does nothing, where it acts only beyond one."""
        return inf

    @classmethod
    def is_met(cls, p: Mapping[str, float], low: float, high: float) -> bool:
        """Tell whether a record between two positions ever comes to where it does nothing, if it acts only beyond a
        limit: else it shows a spring and a load, and no limit.
        """
        return cls.free_within(p) >= max(low, -high, 0.0)

    @classmethod
    def is_resolved(cls, p: Mapping[str, float], step: float) -> bool:
        """Tell whether samples so many s apart can show it: the instant of a sample is not known to the last digit."""
        return True

    def force(self, m: Any, x: Any, p: Any) -> Any:
        """Return the force on the moving mass."""
        return 0

    def rates(self, m: Any, x: Any, p: Any) -> dict[str, Any]:
        """Return the time derivatives of the own states."""
        return {}

    def input(self, m: Any, u: Any, p: Any) -> Any:
        """Return the input of the plant, in its unit, when ``u`` is commanded."""
        return u

    def delay(self, p: Any) -> Any:
        """Return the time in s by which the input arrives late."""
        return 0.0

    def spring(self, m: Any, x: Any, p: Any, k: Any) -> Any:
        """Return the changed restoring force, in the unit of ``k q``, of the plant's own spring; None: no change."""
        return None

    def torque_constant(self, m: Any, x: Any, p: Any, K_t: Any) -> Any:
        """Return a motor's changed torque constant in N·m/A."""
        return K_t

    def resistance(self, m: Any, x: Any, p: Any, R_a: Any) -> Any:
        """Return a motor's changed armature resistance in Ohm."""
        return R_a

    @classmethod
    def pars_on(cls, channels: Mapping[str, str]) -> Pars:
        """Return the declared parameters by their names in a model file, given a plant's channels and their units."""
        return cls.pars()

    @classmethod
    def summary(cls) -> str:
        """Return the first line of the docstring."""
        return next(iter((cls.__doc__ or "").strip().splitlines()), "")


class SensorEffect(Effect):
    """What a sensor does to what it measures: it changes no equation, only what is shown.

    One `Par` is declared. A model file gives it for each channel that it is on, by the channel's name:
    ``sensor_offset: {speed: 0.1}``. Channels that are not named have its default.
    """

    def sensor(self, before: Sensor, value: float) -> Sensor:
        """Return the sensor changed by this effect with its parameter's value."""
        raise NotImplementedError

    @classmethod
    def shown_on(cls, channel: str, value: Shown) -> str:
        """Return the sentence on what a record shows of it on a channel."""
        if cls.finding:
            return cls.finding.format(channel=channel, value=value, unit=value.unit)
        return f"the {channel} shows {printed_name(cls.name)}: {value:.3g} {value.unit}".removesuffix(" -").rstrip()

    @classmethod
    def pars_on(cls, channels: Mapping[str, str]) -> Pars:
        """Return the one declaration for every channel, in the channel's unit where it is `CHANNEL_UNIT`."""
        (par,) = cls.pars().values()
        units = {name: unit if par.unit == CHANNEL_UNIT else par.unit for name, unit in channels.items()}
        return Pars({name: replace(par, unit=unit) for name, unit in units.items()})
