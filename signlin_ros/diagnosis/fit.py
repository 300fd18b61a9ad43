"""Output error fit, corrected by an observer: base parameters with priors, effects from their starts.

The objective is -2 log likelihood of the innovations with an unknown variance for each channel,
sum_c n_c ln(RSS_c / n_c), plus the priors; Levenberg and Marquardt's method with analytic sensitivities
[Ljung, System Identification, 1999, ch. 7 and 10; Nocedal and Wright, Numerical Optimization, 2006, ch. 10].
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from signlin_ros.diagnosis.equations import Equations, equations
from signlin_ros.diagnosis.follow import MOST, NONE_LATE, follow
from signlin_ros.diagnosis.problem import Gains, Problem, Segment, _twin
from signlin_ros.effects import find_effect
from signlin_ros.model import Model
from signlin_ros.par import Par, declared_name

Array = NDArray[np.float64]

KNOWN_EFFECT = 0.2
"""Relative standard deviation of the prior on the parameters of effects that the model already has."""
ENOUGH = 0.02
"""A fit ends where a step lowers -2 log likelihood by less than this,"""
FAR = 1e-3
"""or by less than this share of its distance from that of pure noise: a wrong model need not be fitted to the end."""
RESTING, MEMORY = 0.02, 400
"""A record is at rest below this share of the RMS velocity; else what is remembered is fitted to so many samples."""
SECANTS, SETTLED = 8, 1e-3
"""Most secants, and the share of the squared errors below which another one gains nothing."""
SWEEPS, NEARBY, REMEMBERED = 4, 0.1, 3.0
"""Most steps of all that is unknown of a start together, the part of its reach by which slopes are found, and so many
time constants of the observer as that is remembered."""
GAIN = 0.7
"""Largest logarithm of a sensor's gain: about twice or half; more would stand in for an inertia that is known."""
APART, WANDER = 0.3, 0.05
"""How uncertain the start of a load is that floats, as a part of an excursion and of the velocity (RMS), and the part
of that by which it may wander in a second, to begin with."""
NEAR = 3.0
"""Largest change of the logarithm of a floating load's inertia: one much larger stands still, and is a spring."""
TURN, FASTER = 0.8, 1.5
"""Largest phase in rad by which a periodic force may turn in a substep, at that multiple of the RMS velocity."""
ENDLESS = 1e100
"""Curvature of the objective from which on sensitivities have run away: such a model counts as one that diverges."""
SHAPE = 3.0
"""Standard deviation of the prior on the logarithm of a new effect's positive parameters."""


@dataclass(frozen=True)
class Coordinate:
    """A free parameter as the search sees it: its logarithm, or itself divided by ``unit``."""

    name: str
    log: bool
    unit: float
    low: float
    high: float
    prior: float
    spread: float

    def value(self, theta: float) -> float:
        """Return the parameter for a coordinate."""
        return float(np.exp(theta) * self.unit) if self.log else theta * self.unit

    def theta(self, value: float) -> float:
        """Return the coordinate for a parameter."""
        return float(np.log(max(value, 1e-300) / self.unit)) if self.log else value / self.unit

    def slope(self, theta: float) -> float:
        """Return d parameter / d coordinate."""
        return self.value(theta) if self.log else self.unit


@dataclass(frozen=True)
class Candidate:
    """A model to be fitted: its free parameters as coordinates, its values elsewhere.

    ``alert``: whether an extended Kalman filter follows it where its motion is sensitive; ``wander``: by which part of
    the velocity (RMS) that of a floating load may wander in a second, as the filter takes it.
    """

    model: Model
    equations: Equations
    coordinates: tuple[Coordinate, ...]
    values: dict[str, float]
    label: tuple[str, ...] = ()
    alert: bool = True
    wander: float = WANDER

    @functools.cached_property
    def angular(self) -> bool:
        """Whether a force depends on the angle from turn to turn, and so on where exactly a record starts."""
        return any(find_effect(use.type, "effects").angular for use in self.model.effects.values())

    @property
    def filtered(self) -> bool:
        """Whether an extended Kalman filter follows it."""
        return self.alert and (self.angular or bool(self.floating))

    @functools.cached_property
    def floating(self) -> frozenset[str]:
        """The own states that an observer must correct."""
        keys = [k for k, use in self.model.effects.items() if find_effect(use.type, "effects").floating]
        return frozenset(n for n in self.model.states if n.partition(".")[0] in keys)

    def p(self, theta: Array) -> Array:
        """Return all parameters in the order of the equations."""
        values = dict(self.values)
        for c, x in zip(self.coordinates, theta, strict=True):
            values[c.name] = c.value(float(x))
        return np.array([values[name] for name in self.equations.parameters])

    @property
    def bounds(self) -> tuple[Array, Array]:
        """The least and the largest coordinates."""
        return np.array([k.low for k in self.coordinates]), np.array([k.high for k in self.coordinates])

    def start(self, known: Mapping[str, float] | None = None) -> Array:
        """Return the coordinates of the values that the candidate starts from, or of those that are ``known``."""
        values = {**self.values, **(known or {})}
        return np.array([c.theta(values[c.name]) for c in self.coordinates])


@dataclass(frozen=True)
class Filter:
    """Prewhitening of the innovations of every channel: v_k = e_k - rho e_(k-1) + theta v_(k-1), rho and theta (ny).

    theta is that of AR(1) noise with white noise beside it; empty where none has any.
    """

    rho: Array
    theta: Array = field(default_factory=lambda: np.zeros(0))

    def apply(self, values: Array) -> Array:
        """Return the filtered innovations or derivatives (T, ny, ...); the first sample is kept."""
        if not self.rho.any():
            return values
        rho = self.rho.reshape(1, -1, *([1] * (values.ndim - 2)))
        result = values.copy()
        result[1:] -= rho * values[:-1]
        for c in np.flatnonzero(self.theta):
            known = np.isfinite(result[:, c])
            averaged = lfilter([1.0], [1.0, -self.theta[c]], np.where(known, result[:, c], 0.0), axis=0)
            result[:, c] = np.where(known, averaged, np.nan)
        return np.asarray(result)


@dataclass(frozen=True)
class Fit:
    """A fitted candidate: coordinates, objective, innovations of every record, half the objective's curvature and slope
    there.
    """

    candidate: Candidate
    theta: Array
    cost: float
    count: Array
    innovations: tuple[Array, ...]
    hessian: Array
    gains: Gains
    filter: Filter
    gradient: Array

    def parameters(self) -> dict[str, float]:
        """Return the free parameters by name."""
        return {c.name: c.value(float(x)) for c, x in zip(self.candidate.coordinates, self.theta, strict=True)}

    def fitted(self) -> Model:
        """Return the candidate's model with the fitted values; what its sensors add is not part of it."""
        model = self.candidate.model
        declared = {n.split(".", 1)[1]: par for n, par in model.par_declarations().items()}
        plain = {n: v for n, v in self.parameters().items() if not n.startswith("sensor_")}
        return model.with_parameters({n: declared[n].nearest(v) for n, v in plain.items()})


def tidied(f: Fit) -> Fit:
    """Return a fit whose added periodic forces have positive amplitudes and phases within half a turn."""
    theta, signs = f.theta.copy(), np.ones(f.theta.size)
    at = {k.name: i for i, k in enumerate(f.candidate.coordinates)}
    for key in f.candidate.label:
        use = f.candidate.model.effects.get(key)
        turning = find_effect(use.type, "effects").turning if use else ()
        if not turning or any(f"{key}.{name}" not in at for name in turning):
            continue
        amplitude, phase = (at[f"{key}.{name}"] for name in turning)
        unit = f.candidate.coordinates[phase].unit
        if theta[amplitude] < 0:
            theta[amplitude], signs[amplitude] = -theta[amplitude], -1.0
            theta[phase] += np.pi / unit
        theta[phase] -= 2 * np.pi / unit * np.round(theta[phase] * unit / (2 * np.pi))
    return replace(f, theta=theta, hessian=f.hessian * np.outer(signs, signs), gradient=f.gradient * signs)


def base_coordinates(problem: Problem, model: Model) -> list[Coordinate]:
    """Return the base parameters that may move: those that are neither frozen nor exactly 0, with their priors."""
    result = []
    for name, par in model.plant.pars().items():
        nominal = problem.base.parameters[name]
        spread = model.tolerance.get(name, 0.05) if isinstance(model.tolerance, dict) else model.tolerance
        if name in model.frozen or nominal == 0.0 or par.structural or name not in model.trace.parameters or not spread:
            continue
        result.append(_coordinate(name, par, nominal, spread))
    for key, use in problem.base.effects.items():
        effect = find_effect(use.type, "effects")
        pars = effect.pars()
        for name, value in use.parameters.items():
            full, whole = f"{key}.{name}", declared_name(name) in effect.whole_orders
            if value != 0.0 and full in model.trace.parameters and not whole:
                result.append(_coordinate(full, pars[name], value, KNOWN_EFFECT))
    return result


def _coordinate(name: str, par: Par, nominal: float, spread: float) -> Coordinate:
    if nominal > 0 and par.low >= 0:
        return Coordinate(name, True, nominal, -20.0, 20.0, 0.0, spread)
    return Coordinate(
        name, False, abs(nominal), par.low / abs(nominal), par.high / abs(nominal), np.sign(nominal), spread
    )


def effect_coordinates(problem: Problem, model: Model, key: str) -> list[Coordinate]:
    """Return the parameters of a new effect that a fit moves; positive ones by their logarithm."""
    use = model.effects[key]
    effect = find_effect(use.type, "effects")
    pars = effect.pars()
    result = []
    for name, value in use.parameters.items():
        par, full = pars[name], f"{key}.{name}"
        if declared_name(name) in effect.held or par.structural or full not in model.trace.parameters:
            continue
        if name in effect.periodic[:1] and problem.turns:
            continue  # a whole number
        if par.positive or (effect.floating and par.low >= 0.0 and value > 0.0):
            reach = NEAR if par.positive and effect.floating else 12.0
            result.append(Coordinate(full, True, value, -reach, reach, 0.0, SHAPE))
        else:
            unit = 1.0 if name in effect.periodic[:1] else problem.scale.of(par.unit)  # an order comes from a scan
            low, high = effect.within.get(name, (par.low, par.high))
            result.append(Coordinate(full, False, unit, low / unit, high / unit, 0.0, np.inf))
    return result


def candidate(
    problem: Problem, model: Model, added: tuple[str, ...], sensors: dict[str, float] | None = None
) -> Candidate:
    """Return a model as a candidate: base parameters, the effects ``added`` and the ``sensors`` are free.

    ``sensors``: names such as ``sensor_offset.speed`` with their starting values.
    """
    coordinates = base_coordinates(problem, model)
    for key in added:
        coordinates += effect_coordinates(problem, model, key)
    for name in sensors or {}:
        coordinates.append(_sensor_coordinate(problem, name))
    free = tuple(c.name for c in coordinates)
    eq = equations(model.structure, problem.channels, free)
    values = {name: model.value(name) for name in model.trace.parameters}
    known = {**_known_sensors(problem), **(sensors or {})}
    for name in eq.parameters[len(values) :]:
        values[name] = known.get(name, 1.0 if name.startswith("sensor_gain") else 0.0)
    return Candidate(model, eq, tuple(coordinates), values, added + tuple(sensors or ()))


def _known_sensors(problem: Problem) -> dict[str, float]:
    """Return what the base model says of its sensors."""
    found = {}
    for channel in problem.channels:
        sensor = problem.base.sensors.get(channel)
        if sensor:
            values = {"gain": sensor.gain, "offset": sensor.offset, "delay": sensor.delay}
            found.update({f"sensor_{what}.{channel}": value for what, value in values.items()})
    return found


def _sensor_coordinate(problem: Problem, name: str) -> Coordinate:
    if name.startswith("sensor_gain"):
        return Coordinate(name, True, 1.0, -GAIN, GAIN, 0.0, GAIN / 2)
    if name.startswith("sensor_delay"):
        return Coordinate(name, False, problem.scale.step, 0.0, 1.0 / problem.scale.step, 0.0, np.inf)
    unit = float(problem.noise[problem.channels.index(name.partition(".")[2])])
    return Coordinate(name, False, unit, -1e9, 1e9, 0.0, np.inf)


def _initial(c: Candidate, s: Segment) -> Array:
    x0 = []
    for name in c.model.states:
        source = name if name in s.start else _twin(name, tuple(s.start))
        x0.append(s.start.get(source, 0.0))
    return np.array(x0)


@np.errstate(over="ignore", invalid="ignore")
def follow_records(
    problem: Problem,
    c: Candidate,
    theta: Array,
    gains: Gains,
    with_s: bool,
    segments: tuple[Segment, ...] | None = None,
) -> tuple[list[Array], list[Array], list[Array]] | None:
    """Return innovations (T, ny), their derivatives to the free parameters (T, ny, np and more columns of 0) and states
    (T, n) for every record; None if it diverges.

    While a delayed input is still that from before the record, which nobody knows, the observer stays wide awake, and
    what it leaves counts as much as the rest, of which a fit gains nothing.
    """
    p, eq = c.p(theta), c.equations
    ny, flags = eq.sizes[2], eq.flags(with_s, _turns(problem, c, p))
    scale = _scale(problem, c)
    delay = max(float(eq.delay @ p), 0.0)
    lags = seen_late(problem, c, p)
    shown = [p[eq.parameters.index(f"sensor_gain.{channel}")] for channel in problem.channels]
    belief, variances = _belief(problem, c, gains, dict(zip(problem.channels, shown, strict=True))), problem.noise**2
    errors, derivatives, states, ringing = [], [], [], eq.ringing(p, scale)
    for s in segments or problem.segments:
        rows = gains.rows(c.model.states) / np.array(shown)
        rows[:, [name in c.floating for name in c.model.states]] = 0.0  # corrected by the Kalman filter, or not at all
        E, D = np.zeros((s.t.size, ny)), np.empty((s.t.size if with_s else 0, ny, flags[-1]))
        X = np.zeros((0, 0)) if with_s else np.zeros((s.t.size, len(c.model.states)))
        late = _unseen_before(problem, s, lags)
        rest = (p, scale, delay - s.early, ringing, late, belief, variances)
        x0 = _start(problem, c, s, gains.tau, (rows, *rest)) - _led_back(problem, c, s, delay)
        own = [i for i, name in enumerate(c.model.states) if "." in name and not _twin(name, tuple(s.start))]
        if s.before and own:
            lead = follow_records(problem, c, theta, gains, False, (s.before,))
            if lead is None:
                return None
            x0[own] = lead[2][0][-1, own]
        unknown = ceil(delay / problem.scale.step) + 1 if delay > 0.0 else 0
        held, weights = rows, gains.weights[: s.t.size]
        if unknown:
            held = np.concatenate([np.repeat(rows[:1], unknown, axis=0), rows])
            weights = np.concatenate([np.zeros((unknown, ny)), gains.weights])[: s.t.size]
        arguments = (flags, s.t, s.u, s.y, held, x0, *rest)
        if follow(eq.calls(with_s, c.filtered), *arguments, E, D, X) < s.t.size or np.isinf(E).any():
            return None
        E[: weights.shape[0]] *= weights
        if unknown or late[:, 3:].any():
            unseen = (np.arange(len(E)) < unknown)[:, None] | np.isnan(E) & bool(late[:, 3:].any())
            _fill(E, unseen & np.isfinite(s.y), problem.noise)
        if with_s:
            D[: weights.shape[0]] *= weights[:, :, None]
        errors.append(E)
        derivatives.append(D)
        states.append(X)
    return errors, derivatives, states


def _fill(E: Array, what: NDArray[np.bool_], noise: Array) -> None:
    """Put the root mean square of the others in place of some innovations (T, ny); the noise where there are none."""
    rest = np.isfinite(E) & ~what
    squares = np.sum(np.where(rest, E, 0.0) ** 2, axis=0) / np.maximum(rest.sum(axis=0), 1)
    usual = np.where(rest.any(axis=0), np.sqrt(squares), noise)
    E[what] = np.broadcast_to(usual, E.shape)[what]


def _led_back(problem: Problem, c: Candidate, s: Segment, delay: float) -> Array:
    """Return how far (n,) an imposed motion led in the time by which it is seen late; nothing of others."""
    plant, back = problem.base.plant, np.zeros(len(c.model.states))
    if delay and problem.scale.imposed and plant.position in c.model.states:
        back[c.model.states.index(plant.position)] = delay * s.u[0, c.model.inputs.index(plant.velocity)]
    return back


def _turns(problem: Problem, c: Candidate, p: Array) -> int:
    """Return the substeps that periodic forces ask for: the phase of each must not turn by more than `TURN` in one."""
    turned = 0.0
    for key, use in c.model.effects.items():
        for name in find_effect(use.type, "effects").periodic[:1]:
            order = p[c.equations.parameters.index(f"{key}.{name}")]
            turned = max(turned, abs(order) * FASTER * problem.scale.velocity * problem.scale.step)
    return ceil(min(turned / TURN, MOST))


def _belief(problem: Problem, c: Candidate, gains: Gains, shown: Mapping[str, float]) -> Array:
    """Return what `follow` takes for an extended Kalman filter where motion is sensitive; (3, 0) where it is not.

    What a sensor shows larger than it is (``shown``: its gain, by channel) moves less than it seems to: else a gain
    would fit the filter, not the motion.
    """
    names, floating, scale = c.model.states, c.floating, problem.scale
    if not c.filtered or not gains.spread.size:
        return np.zeros((3, 0))
    apart = {"position": scale.excursion, "velocity": scale.velocity}
    plant, found = problem.base.plant, np.ones((3, len(names)))
    motion = next((shown[n] for n in (plant.position, plant.velocity) if n in shown), 1.0)
    for i, name in enumerate(names):
        larger = shown.get(name, motion if name in (plant.position, plant.velocity) or name in floating else 1.0) ** 2
        if name in gains.names:
            found[:2, i] = gains.spread[:, gains.names.index(name)] / larger
            continue
        own = name.rpartition(".")[2]
        size = APART * apart.get(own, 0.0) if name in floating else 0.0
        added, first = c.wander**2 * size**2 * scale.step, size**2
        found[:, i] = added / larger, first / larger, 2.0 if own == "position" else 1.0
    return found


def _start(problem: Problem, c: Candidate, s: Segment, tau: float, rest: tuple[Any, ...]) -> Array:
    """Return the state (n,) that a record starts from.

    Where it starts in motion, what an effect remembers (a bristle's bend, a temperature, by how much a load lags) is
    fitted to the first samples by secants: it is no parameter, since its derivative vanishes where it is best. Where
    nobody saw the position, all that is unknown is then fitted together, to as many samples as an observer of time
    constant ``tau`` in s remembers it; a wrong model would bend to its ends a position that was seen.
    """
    x0 = _initial(c, s)
    rows, *others = rest
    unknown = {**_unknown(problem, c, s), **_late_states(problem, s, others[4])} if s.whole else {}
    if not unknown:
        return x0
    eq = c.equations

    def run(x: Array, size: int) -> tuple[Array, Array]:
        t, u, y = s.t[:size], s.u[:size], s.y[:size]
        E, X = np.zeros((size, y.shape[1])), np.zeros((size, x.size))
        arguments: tuple[Any, ...] = (eq.flags(False, _turns(problem, c, others[0])), t, u, y, rows, x, *others)
        arguments = (eq.calls(False, c.filtered), *arguments, E, np.zeros((0, y.shape[1], eq.sizes[3])), X)
        if follow(*arguments) < size:
            E[:] = np.inf
        return np.nan_to_num(E / problem.noise, posinf=1e150).ravel(), X

    size, reaches = min(s.t.size, MEMORY), []
    e, X = run(x0, size)
    for i, (twin, known) in unknown.items():
        apart = X[:, i] - (X[:, twin] if twin >= 0 else 0.0)
        reaches.append((known or float(np.abs(apart).max())) * np.eye(x0.size)[i])
        x0, e = _by_secants(lambda x: run(x, size)[0], x0, e, reaches[-1])
    position = problem.base.plant.position
    if position in s.start or position not in c.model.states:
        return x0
    longer = min(s.t.size, max(size, ceil(REMEMBERED * tau / problem.scale.step)))
    return _descended(lambda x: run(x, longer)[0], x0, run(x0, longer)[0], np.array(reaches), SWEEPS)[0]


def _unknown(problem: Problem, c: Candidate, s: Segment) -> dict[int, tuple[int, float]]:
    """Return the states whose start is fitted: (what each moves with or -1, by how much it may be off).

    0: as far as it ever gets from what it moves with. A velocity is among them where it was not measured, but other
    channels than the position tell of it, and what bends with it.
    """
    names, plant = c.model.states, problem.base.plant
    unknown: dict[int, tuple[int, float]] = {}
    if _moving(problem, s):
        twins = {i: _twin(n, names) for i, n in enumerate(names) if "." in n and not (c.filtered and n in c.floating)}
        others = set(problem.channels) - {plant.position}
        if others and plant.velocity in names and plant.velocity not in others and not all(twins.values()):
            unknown[names.index(plant.velocity)] = (-1, abs(s.start.get(plant.velocity, 0.0)))
        unknown |= {i: (names.index(twin) if twin else -1, 0.0) for i, twin in twins.items()}
        if plant.position in names and plant.position not in s.start:
            unknown[names.index(plant.position)] = (-1, 0.0)
    if c.angular and plant.position in s.start and plant.position in problem.channels:
        unknown[names.index(plant.position)] = (-1, float(problem.noise[problem.channels.index(plant.position)]))
    return unknown


def _late_states(problem: Problem, s: Segment, lags: Array) -> dict[int, tuple[int, float]]:
    """Return the states of which a record first shows what they were before it, and how far they get in that time."""
    found = {}
    for y, (lag, state, _, marked) in zip(s.y.T, lags.tolist(), strict=False):
        count = min(ceil(lag / problem.scale.step), s.t.size - 1)
        if marked and count > 0:
            found[int(state)] = (-1, float(np.sqrt(np.nanmean((y[count:] - y[:-count]) ** 2))))
    return found


def _by_secants(errors: Callable[[Array], Array], x: Array, e: Array, reach: Array) -> tuple[Array, Array]:
    """Return the point x (n,) moved along ``reach`` (n,) to where the errors are least, and these."""
    tried = [(x + sign * reach, errors(x + sign * reach)) for sign in (-1.0, 1.0)]
    x, e = min([(x, e), *tried], key=lambda pair: float(pair[1] @ pair[1]))
    return _descended(errors, x, e, reach[None], SECANTS)


def _descended(errors: Callable[[Array], Array], x: Array, e: Array, reaches: Array, most: int) -> tuple[Array, Array]:
    """Return the point x (n,) moved in the span of ``reaches`` (k, n) to where the errors are least, and these: steps
    of Gauss and Newton with secants for slopes.
    """
    near = NEARBY * reaches
    for _ in range(most):
        changes = np.stack([errors(x + r) - e for r in near])
        products = changes @ changes.T
        if not 0.0 < products.max() < np.inf:
            break
        moved = x - np.linalg.lstsq(products, changes @ e, rcond=1e-13)[0] @ near
        new = errors(moved)
        gained = e @ e - new @ new
        if gained > 0:
            x, e = moved, new
        if not gained > SETTLED * (e @ e):
            break
    return x, e


def _scale(problem: Problem, c: Candidate) -> Array:
    """Return the size of every state (n,): as the problem has it, or that of what it moves with."""
    known, units = problem.x_scale, c.model.trace.units
    sizes = {n: known.get(n) or known.get(_twin(n, tuple(known)), 0.0) for n in c.model.states}
    own = {True: problem.scale.travel, False: 100.0}
    return np.array([size or own[units[name] == problem.base.plant.position_unit] for name, size in sizes.items()])


def seen_late(problem: Problem, c: Candidate, p: Array) -> Array:
    """Return by how much every channel is seen late, for `follow`."""
    names = [f"sensor_delay.{channel}" for channel in problem.channels]
    free = [k.name for k in c.coordinates]
    if not any(name in free or c.values[name] for name in names):
        return NONE_LATE
    rows = []
    for name, channel in zip(names, problem.channels, strict=True):
        state = c.model.states.index(channel) if channel in c.model.states else 0
        rows.append((p[c.equations.parameters.index(name)], state, free.index(name) if name in free else -1, 0.0))
    return np.array(rows, dtype=float)


def _unseen_before(problem: Problem, s: Segment, lags: Array) -> Array:
    """Return the lags of channels, late ones marked where a record starts in motion that nobody saw before it."""
    marked: Array = lags.copy()
    marked[:, 3:] = (s.inner or (s.whole and _moving(problem, s))) and not problem.scale.imposed
    return marked


def _moving(problem: Problem, s: Segment) -> bool:
    """Tell whether a record starts in motion, for all that is known."""
    return bool(abs(s.start.get(problem.base.plant.velocity, np.inf)) > RESTING * problem.scale.velocity)


def _normal(
    problem: Problem, c: Candidate, theta: Array, found: tuple[list[Array], list[Array], list[Array]], filter: Filter
) -> tuple[float, Array, Array, Array]:
    """Return cost, number of samples (ny), gradient and Gauss-Newton Hessian."""
    ny, count = c.equations.sizes[2], theta.size
    rss, number = np.zeros(ny), np.zeros(ny)
    squares, products = np.zeros((ny, count, count)), np.zeros((ny, count))
    for E, D in zip(found[0], found[1], strict=True):
        e, d = filter.apply(E), filter.apply(D)[:, :, :count]
        there = np.isfinite(e)
        if not there.all():
            e, d = np.where(there, e, 0.0), np.where(there[: len(d), :, None], d, 0.0)
        for k in range(ny):
            number[k] += np.count_nonzero(there[:, k])
            rss[k] += e[:, k] @ e[:, k]
            if d.shape[0]:
                squares[k] += d[:, k].T @ d[:, k]
                products[k] += e[:, k] @ d[:, k]
    floor = (1e-9 * problem.noise) ** 2 * np.maximum(number, 1)
    rss = np.maximum(rss, floor)
    prior = np.array([(x - k.prior) / k.spread for k, x in zip(c.coordinates, theta, strict=True)])
    inverse = np.array([1.0 / k.spread for k in c.coordinates])
    cost = float(np.sum(number * np.log(rss / np.maximum(number, 1))) + np.sum(prior**2))
    weights = number / rss
    slopes = np.array([k.slope(float(x)) for k, x in zip(c.coordinates, theta, strict=True)])
    gradient = slopes * (weights @ products) + prior * inverse
    hessian = np.outer(slopes, slopes) * np.tensordot(weights, squares, 1) + np.diag(inverse**2)
    return cost, number, gradient, hessian


def likelihood(problem: Problem, c: Candidate, theta: Array, gains: Gains) -> float:
    """Return the objective of `fit` at one point, infinite where the model diverges."""
    found = follow_records(problem, c, theta, gains, False)
    if found is None:
        return np.inf
    cost = _normal(problem, c, theta, found, Filter(np.zeros(c.equations.sizes[2])))[0]
    return cost if np.isfinite(cost) else np.inf


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def fit(
    problem: Problem,
    c: Candidate,
    gains: Gains,
    theta: Array | None = None,
    steps: int = 10,
    filter: Filter | None = None,
    far: float = FAR,
) -> Fit | None:
    """Fit a candidate at one gain, from theta (its own start by default); None if the start diverges."""
    low, high = c.bounds
    first = evaluated(problem, c, np.clip(c.start() if theta is None else theta, low, high), gains, filter)
    return None if first is None else further(problem, first, steps, far)


def evaluated(problem: Problem, c: Candidate, x: Array, gains: Gains, filter: Filter | None) -> Fit | None:
    """Return a candidate at one point, as if it were fitted; None if it diverges there."""
    whiten = filter or Filter(np.zeros(c.equations.sizes[2]))
    found = follow_records(problem, c, x, gains, True)
    if found is None:
        return None
    cost, number, gradient, hessian = _normal(problem, c, x, found, whiten)
    if not (np.isfinite(cost) and np.abs(hessian).max(initial=0.0) < ENDLESS):
        return None
    return Fit(c, x, cost, number, tuple(found[0]), hessian, gains, whiten, gradient)


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def further(problem: Problem, f: Fit, steps: int, far: float = FAR) -> Fit:
    """Go on with a fit for some steps of Levenberg and Marquardt's method."""
    low, high = f.candidate.bounds
    damping = 1e-3
    for _ in range(steps):
        new = _step(f.theta, f.gradient, f.hessian, damping, low, high)
        shift = new - f.theta
        if float(-2 * f.gradient @ shift - shift @ f.hessian @ shift) < ENOUGH:
            break
        trial = evaluated(problem, f.candidate, new, f.gains, f.filter)
        if trial is None or not trial.cost < f.cost:
            damping *= 16
            if damping > 1e9:
                break
            continue
        gain, f = f.cost - trial.cost, trial
        damping = max(damping / 8, 1e-9)
        if gain < ENOUGH + far * max(f.cost - float(np.sum(f.count * np.log(problem.noise**2))), 0.0):
            break
    return f


def _step(x: Array, gradient: Array, hessian: Array, damping: float, low: Array, high: Array) -> Array:
    """Return the damped Gauss-Newton step, projected on the bounds; what leaves them is taken out and solved anew."""
    active = np.zeros(x.size, dtype=bool)
    new = x.copy()
    for _ in range(x.size + 1):
        free = np.flatnonzero(~active)
        if not free.size:
            return np.asarray(new)
        rows = hessian[free]
        diagonal = rows[np.arange(free.size), free]
        matrix = rows[:, free]
        matrix[np.diag_indices(free.size)] += damping * diagonal + 1e-12 * max(diagonal.max(), 1e-300)
        right = gradient[free] + rows[:, active] @ (new - x)[active]
        new[free] = x[free] - np.linalg.lstsq(matrix, right, rcond=1e-13)[0]
        outside = (new < low) | (new > high)
        new = np.clip(new, low, high)
        if not outside.any():
            return np.asarray(new)
        active |= outside
    return np.asarray(new)


__all__ = [
    "Candidate",
    "Coordinate",
    "Filter",
    "Fit",
    "candidate",
    "evaluated",
    "fit",
    "follow_records",
    "further",
    "likelihood",
    "seen_late",
    "tidied",
]
