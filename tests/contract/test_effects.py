"""The one suite that every effect runs on every plant that it applies to. A new effect is picked up by itself."""

import inspect
import re
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from signlin_ros.compiled import exact_tape, scales, smooth_function
from signlin_ros.console import catalogue
from signlin_ros.effects import CATALOGUE, EFFECTS, SensorEffect
from signlin_ros.effects.base import Effect, Shown
from signlin_ros.effects.declared import check_declared
from signlin_ros.errors import ModelError
from signlin_ros.linearization import METHODS, Linearizer
from signlin_ros.mathops import NumpyMath, SympyMath
from signlin_ros.model import Model
from signlin_ros.nodes.overrides import entries_of
from signlin_ros.nodes.overrides import model_of as model_of_node
from signlin_ros.par import Namespace, as_law_sees, nominal_values
from signlin_ros.plants import PLANTS
from signlin_ros.sensors import Sensor

SIZES = {"A": 1.5, "V": 3.0, "rad": 1.2, "rad/s": 4.0, "m": 0.8, "m/s": 0.9, "N": 2.0, "N·m": 0.05, "K": 30.0}
PAIRS = [
    pytest.param(effect, plant, id=f"{effect.name}-{plant.name}")
    for effect in EFFECTS.values()
    for plant in PLANTS.values()
    if catalogue.applies(effect, plant)
]
every_pair = pytest.mark.parametrize(("effect", "plant"), PAIRS)
every_effect = pytest.mark.parametrize("effect", EFFECTS.values(), ids=lambda e: e.name)


def model_of(effect, plant):
    """The plant with the effect, and a load, so that friction that depends on loads has one; own parameters set."""
    model = catalogue.nominal_model(plant, effect)
    if plant.name == "dc_motor":
        model = model.with_parameters(B=1e-4)
    return model if effect.name == "constant_load" else model.with_effect("constant_load", F0=0.013)


def points(model, count=12, factor=1.0):
    """Points away from 0, in every direction: x (count, n), u (count, m)."""
    rng = np.random.default_rng(len(model.states))
    names = (*model.states, *model.inputs)
    size = np.array([SIZES.get(model.units[name], 0.7) for name in names])
    z = rng.uniform(0.2, 1.0, (count, len(names))) * rng.choice([-1.0, 1.0], (count, len(names)))
    return np.split(factor * z * size, [len(model.states)], axis=1)


def test_every_file_of_an_effect_is_in_the_catalogue_once():
    files = {path.stem for path in Path(inspect.getfile(Effect)).parent.glob("*.py")} - {
        "__init__",
        "base",
        "declared",
        "interest",
    }
    assert sorted(CATALOGUE) == sorted(files)
    assert [EFFECTS[name].__module__ for name in CATALOGUE] == [f"signlin_ros.effects.{name}" for name in CATALOGUE]


class Acting:
    """The effects of a model as its plant sees them, on plain numbers: this test's own reading of the contract."""

    def __init__(self, model, x):
        self.m, self.x, self.model = NumpyMath(), x, model
        taken = [(EFFECTS[n](), n, {k: model.parameters[k] for k in p}) for n, p in model.plant.built_in.items()]
        used = [(EFFECTS[use.type](), key, use.parameters) for key, use in model.effects.items()]
        self.uses = [(effect, key, as_law_sees(effect.pars(), values)) for effect, key, values in taken + used]
        self.rename = model.plant.own_state_names

    def own(self, effect, key, values):
        names = {n: self.rename.get(f"{key}.{n}", f"{key}.{n}") for n in effect.states}
        self.x.own = Namespace({n: values[full] for n, full in names.items()})
        return self.x

    def spring(self, k):
        for effect, key, p in self.uses:
            changed = None if hasattr(p, "k") else effect.spring(self.m, self.own(effect, key, self.values), p, k)
            if changed is not None:
                return changed
        return k * self.x.position

    def torque_constant(self, K_t):
        for effect, key, p in self.uses:
            K_t = effect.torque_constant(self.m, self.own(effect, key, self.values), p, K_t)
        return K_t

    def resistance(self, R_a):
        for effect, key, p in self.uses:
            R_a = effect.resistance(self.m, self.own(effect, key, self.values), p, R_a)
        return R_a

    def input(self, value):
        for effect, _, p in self.uses:
            value = effect.input(self.m, value, p)
        return value

    def force(self, drive, elastic):
        def total(external):
            return sum(
                effect.force(self.m, self.own(effect, key, self.values), p)
                for effect, key, p in self.uses
                if effect.external is external
            )

        loads = total(True)
        self.x.external_force = loads + elastic
        if drive is not None:
            self.x.drive_force = drive
        return loads + total(False)


def by_numpy(model, x, u):
    """The exact right-hand side, evaluated with NumPy from the plant's and the effects' own methods."""
    plant = model.plant()
    values = dict(zip(model.states, x, strict=True))
    coordinates = Namespace(values)
    coordinates.position = values.get(plant.position, 0.0)
    if plant.velocity in values:
        coordinates.velocity = values[plant.velocity]
    act = Acting(model, coordinates)
    act.values = values
    inputs = dict(zip(model.inputs, u, strict=True))
    coordinates.temperature = inputs.get("temperature", 0.0)
    first = model.inputs[0]
    if not plant.closed_loop:  # there they act on the error of the loop, which the plant forms
        inputs[first] = act.input(inputs[first])
    rates = dict(plant.rates(act.m, coordinates, Namespace(inputs), Namespace(model.parameters), act))
    for effect, key, p in act.uses:
        own = effect.rates(act.m, act.own(effect, key, values), p)
        rates |= {act.rename.get(f"{key}.{n}", f"{key}.{n}"): rate for n, rate in own.items()}
    if plant.position in model.states and plant.position_optional:
        rates[plant.position] = coordinates.velocity
    extra = [rates[name] for name in model.plant.outputs]
    return np.array([rates[name] for name in model.states] + extra, dtype=float)


def by_casadi(model, x, u):
    """The exact right-hand side and outputs from the trace, every sign chosen as the sign of its own surface."""
    t = model.trace
    n, k = len(t.states), len(t.surfaces)
    s = np.zeros(k)
    for _ in range(k + 1):  # nested surfaces need one pass for each level
        out = exact_tape(model.structure).batch([*x, *u, *model.p, *s])[:, 0]
        g = out[n : n + k]
        s = np.sign(g)
    outputs = out[len(out) - t.y.numel() :]
    return np.concatenate([out[:n], outputs])


def smooth(model, x, u, order=None):
    """F_j (n), its Jacobian (n, n) and the outputs."""
    n = len(model.states)
    function = smooth_function(model.structure, order or model.sign_order)
    flat = np.array(function(x, u, model.p, scales(model))).ravel()
    return flat[:n], flat[n : n + n * n].reshape(n, n), flat[n + n * n :]


# -------------------------------------------------------------------- declarations


@every_effect
def test_the_effect_declares_itself(effect):
    assert EFFECTS[effect.name] is effect
    assert re.fullmatch(r"[a-z][a-z0-9_]*", effect.name)
    assert effect.equation
    assert effect.summary().endswith(".")
    assert len(effect.summary()) > 15
    check_declared(effect, "the catalogue")
    assert effect.equation.split("=")[0].split(",")[0].strip()[:4] in " ".join(inspect.getdoc(effect).split())
    assert any(catalogue.applies(effect, plant) for plant in PLANTS.values())


@every_effect
def test_every_parameter_has_a_unit_bounds_and_a_sentence(effect):
    assert effect.pars()
    for name, par in effect.pars().items():
        assert par.unit, name
        assert len(par.doc) > 3, name
        assert par.low < par.high, name
        assert par.check(par.written(par.nominal), name) == par.nominal
        if par.default is not None:
            assert par.check(par.written(par.default), name) == par.default
        if par.elements is not None:
            assert par.check_list(par.elements, name) == list(par.elements)


@every_effect
def test_what_is_said_of_parameters_is_said_of_its_own(effect):
    named = {*effect.held, *effect.within, *effect.essential, *effect.turning, *effect.periodic, *effect.whole_orders}
    assert named <= set(effect.pars())


@every_effect
def test_where_it_starts_from_after_another_are_its_own_parameters(effect):
    for simple, cls in EFFECTS.items():
        for start in effect.after(simple, {name: par.nominal for name, par in cls.pars().items()}):
            assert set(start) <= set(effect.pars())


@pytest.mark.parametrize("effect", [e for e in EFFECTS.values() if e.turning], ids=lambda e: e.name)
def test_the_force_is_the_same_half_a_turn_further_with_the_other_sign(effect):
    amplitude, phase = effect.turning
    rest = {name: 1.3 for name in effect.pars() if name not in effect.turning}
    model = Model.from_dict({"plant": "mass_spring_damper", "parameters": {"m": 1.0, "c": 0.0, "k": 0.0}})
    one, other = (
        model.with_effect(effect.name, **rest, **{amplitude: sign * 0.7, phase: 0.4 + turn})
        for sign, turn in ((1.0, 0.0), (-1.0, np.pi))
    )
    for q in (-2.0, 0.3, 1.7):
        assert by_casadi(one, [q, 0.5], [0.2]) == pytest.approx(by_casadi(other, [q, 0.5], [0.2]), abs=1e-12)


@every_effect
def test_every_parameter_matters_and_stands_in_the_equation(effect):
    words = set(re.findall(r"[A-Za-z_]\w*", f"{effect.equation} {effect.__doc__}"))
    for name in effect.pars():
        assert words & {name, f"{name}_i"}, f"{name} is not in the equation of {effect.name}"


@every_effect
def test_the_equation_renders(effect):
    """Every law evaluates to a SymPy expression that prints and holds the effect's parameters."""
    import sympy

    m, real = SympyMath(), {"real": True}
    declared, nominal = effect.pars(), nominal_values(effect.pars())
    pars = {name: sympy.Symbol(name, **real) for name in nominal}
    structural = {name for name in nominal if declared[name].structural}
    fixed = {name: nominal[name] if name not in declared or declared[name].words else 2.0 for name in structural}
    p = as_law_sees(declared, pars | fixed)
    x = Namespace({n: sympy.Symbol(n, **real) for n in ("velocity", "position", "drive_force", "external_force")})
    x.temperature = sympy.Symbol("T", **real)
    x.current, x.resistance = sympy.symbols("i R", real=True)
    x.own = Namespace({name: sympy.Symbol(f"own_{name}", **real) for name in effect.states})
    u, k = sympy.symbols("u k", real=True)
    one = effect()
    laws = [one.force(m, x, p), *one.rates(m, x, p).values(), one.input(m, u, p), one.delay(p)]
    laws += [one.spring(m, x, p, k) or 0, one.torque_constant(m, x, p, k), one.resistance(m, x, p, k)]
    if isinstance(effect(), SensorEffect):
        sensor = one.sensor(Sensor(), *pars.values())
        laws += [sensor.show(k), sensor.delay]
    laws = [sympy.sympify(law) for law in laws]
    found = set().union(*(law.free_symbols for law in laws))
    assert {symbol for name, symbol in pars.items() if name not in structural} <= found
    assert all(sympy.latex(law) for law in laws)


@every_pair
def test_units_are_resolved_for_the_plant(effect, plant):
    model = catalogue.nominal_model(plant, effect)
    for name, par in model.par_declarations().items():
        assert par.unit, name
        letters = set(re.findall(r"[A-Za-z]+", par.unit))
        assert not letters & {"F", "Q", "U"}, f"{name}: {par.unit}"
    assert all(model.units[name] for name in (*model.states, *model.inputs, *model.outputs))


# -------------------------------------------------------------------- equations


@every_pair
def test_numpy_equals_casadi(effect, plant):
    model = model_of(effect, plant)
    for x, u in zip(*points(model), strict=True):
        want, found = by_numpy(model, x, u), by_casadi(model, x, u)
        np.testing.assert_allclose(found, want, rtol=1e-12, atol=1e-12 * np.abs(want).max())


@every_pair
@pytest.mark.parametrize("order", [4, 50])
def test_the_jacobian_is_the_difference_quotient(effect, plant, order):
    """Central differences of width h are off by h^2 f'''/6 and eps |f| / h: 1e-6 of the largest at h = 1e-5."""
    model = model_of(effect, plant)
    n = len(model.states)
    for x, u in zip(*points(model, 4), strict=True):
        _, jacobian, _ = smooth(model, x, u, order)
        for i in range(n):
            h = 1e-5 * np.eye(n)[i]
            ends = [smooth(model, x + sign * k * h, u, order)[0] for k in (1, 2) for sign in (1, -1)]
            quotient = (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12 * 1e-5)  # fourth order
            size = np.abs(jacobian).max(axis=1) + np.abs(ends[0])
            np.testing.assert_allclose(jacobian[:, i], quotient, rtol=1e-6, atol=1e-6 * (1 + size.max()))


@every_pair
def test_f_j_tends_to_f_at_the_stated_rate(effect, plant):
    """1 - |sign_j(z)| is about 2 exp(-2 j artanh b), b = min(|z|, 1/|z|): the error must fall at least that fast."""
    model = model_of(effect, plant).with_options(sign_scale=1.0)
    t = model.trace
    symbols = ca.vertcat(*(s.symbol for s in t.surfaces)) if t.surfaces else ca.SX(0, 1)
    g = ca.Function("g", [t.x, t.u, t.p, symbols], [ca.vertcat(*(s.g for s in t.surfaces), 0)])
    for x, u in zip(*points(model, 6), strict=True):
        exact = by_casadi(model, x, u)[: len(x)]
        s = np.zeros(len(t.surfaces))
        for _ in range(len(s) + 1):
            s = np.sign(np.array(g(x, u, model.p, s)).ravel()[:-1])
        z = np.abs(np.array(g(x, u, model.p, s)).ravel()[:-1])
        if np.any(z < 0.02):
            continue  # that close to a surface only orders of hundreds see the other side
        b = np.minimum(z, 1 / np.maximum(z, 1e-300))
        rate = 2 * np.min(np.arctanh(np.minimum(b, 1 - 1e-12)), initial=20.0)
        scale = np.abs(exact) + 1e3 * np.abs(exact).max() + 1
        for order in (20, 100, 400, 2000):
            error = np.abs(smooth(model, x, u, order)[0] - exact)
            assert np.all(error <= scale * (8 * np.exp(-order * rate) + 1e-12)), order


@pytest.mark.parametrize("effect", [e for e in EFFECTS.values() if e.dissipative], ids=lambda e: e.name)
def test_dissipative_effects_take_energy(effect):
    one, p = effect(), as_law_sees(effect.pars(), nominal_values(effect.pars()))
    rng = np.random.default_rng(3)
    for v, q, drive, external in rng.normal(0.0, 3.0, (200, 4)):
        x = Namespace({"velocity": v, "position": q, "drive_force": drive, "external_force": external})
        x.temperature = 300.0 + 10.0 * q
        assert v * one.force(NumpyMath(), x, p) <= 0.0
    x = Namespace({"velocity": 0.0, "position": 1.0, "drive_force": 1.0, "external_force": 1.0, "temperature": 300.0})
    assert one.force(NumpyMath(), x, p) == 0.0


@every_pair
@pytest.mark.parametrize("method", METHODS)
def test_the_linear_model_is_exact_at_its_point(effect, plant, method):
    model = model_of(effect, plant)
    linear = Linearizer(model, method)
    # the rounding of F itself: what cancels inside it, such as the two sides of a play, is not seen in A x + B u + c
    noise = max(1.0, *(abs(v) for use in model.effects.values() for v in use.parameters.values()))
    for factor in (1.0, 1e-3, 1e-9, 0.0):
        for x, u in zip(*points(model, 3, factor), strict=True):
            r = linear(x, u)
            terms = np.abs(r.A) @ np.abs(r.x) + np.abs(r.B) @ np.abs(r.u) + np.abs(r.c)
            np.testing.assert_array_less(np.abs(r.A @ r.x + r.B @ r.u + r.c - r.f), 1e-13 * terms + 1e-13 * noise)
            np.testing.assert_allclose(r.f, smooth(model, x, u)[0], rtol=1e-11, atol=1e-12 * (1 + terms.max()))


@every_pair
def test_the_batch_is_the_single_call(effect, plant):
    model = model_of(effect, plant)
    linear, (x, u) = Linearizer(model), points(model)
    batch = linear.batch(x, u)
    for k in range(len(x)):
        one = linear(x[k], u[k])
        for name in ("A", "B", "c", "f", "x", "u"):
            np.testing.assert_allclose(getattr(batch, name)[k], getattr(one, name), rtol=1e-13, atol=1e-13)
        assert batch.in_valid_range[k] == one.in_valid_range


# -------------------------------------------------------------------- model files


@every_pair
def test_yaml_keeps_every_digit(effect, plant, tmp_path):
    model = catalogue.nominal_model(plant, effect).with_effect(effect.name, "second")
    declared = model.par_declarations().items()
    name, par = next((n, p) for n, p in declared if n.startswith("effects.second.") and not p.words)
    value = par.nominal * (1 + 2**-52) or 1 / 3
    model = model.with_parameters({name: value})
    file = tmp_path / "model.yaml"
    model.save(file)
    again = Model.load(file)
    assert again == model
    assert again.effects["second"].type == effect.name
    assert again.value(name) == value
    assert again.states == model.states
    assert [name for name in again.states if name.startswith("second.")] == [f"second.{s}" for s in effect.states]


@pytest.mark.parametrize(
    "effect", [e for e in EFFECTS.values() if any(p.elements for p in e.pars().values())], ids=lambda e: e.name
)
def test_lists_are_lists_to_files_and_nodes_and_numbers_to_fits(effect):
    plant = next(plant for plant in PLANTS.values() if catalogue.applies(effect, plant))
    model = catalogue.nominal_model(plant, effect)
    lists = {n: list(par.elements) for n, par in effect.pars().items() if par.elements}
    written = model.to_dict()["effects"][effect.name]
    entries = entries_of(model)
    for name, values in lists.items():
        full = f"effects.{effect.name}.{name}"
        assert written[name] == values == entries[full].value
        assert [model.value(f"{effect.name}.{name}[{i}]") for i in range(len(values))] == values
        other = [value * (1 + 2**-52) for value in values]
        for changes in ({full: other}, {f"{full}[{i}]": value for i, value in enumerate(other)}):
            assert model.with_parameters(changes).to_dict()["effects"][effect.name][name] == other
        with pytest.raises(ModelError, match=rf"{name}\[{len(values)}\]: unknown parameter"):
            model.with_parameters({f"{effect.name}.{name}[{len(values)}]": 1.0})
    again = model_of_node({name: entry.value for name, entry in entries.items()}, [])
    assert (again.effects, again.structure) == (model.effects, model.structure)


# -------------------------------------------------------------------- sensors

SENSORS = [effect for effect in EFFECTS.values() if issubclass(effect, SensorEffect)]
sensor_pairs = pytest.mark.parametrize(
    ("effect", "plant"),
    [pytest.param(e, p, id=f"{e.name}-{p.name}") for e in SENSORS for p in PLANTS.values()],
)


@sensor_pairs
def test_a_sensor_can_be_on_every_state_and_output(effect, plant):
    model = catalogue.nominal_model(plant).with_effect(effect.name)
    (par,) = effect.pars().values()
    channels = dict.fromkeys([*model.states, *model.outputs])
    assert model.effects[effect.name].parameters == dict.fromkeys(channels, par.nominal)
    for channel in channels:
        unit = model.par_declarations()[f"effects.{effect.name}.{channel}"].unit
        assert unit == (model.units[channel] if effect.name == "sensor_offset" else par.unit)


@sensor_pairs
def test_a_sensor_changes_what_is_shown_and_no_equation(effect, plant):
    bare = catalogue.nominal_model(plant)
    for channel in dict.fromkeys([*bare.states, *bare.outputs]):
        model = bare.with_effect(effect.name, **{channel: 0.25})
        assert model.structure == bare.structure
        assert model.sensors[channel] != Sensor()
        assert all(sensor == Sensor() for name, sensor in model.sensors.items() if name != channel)
        assert list(model.sensors) == list(bare.sensors)
        assert model.without_effect(effect.name) == bare


# -------------------------------------------------------------------- what is said of a finding


class LipSeal(Effect):
    """Friction of a lip seal."""

    name = "lip_seal"
    equation = "-mu sign(v)"

    def force(self, m, x, p):
        return -p.mu * m.sign(x.velocity)


class ShortStroke(Effect):
    """A valve."""

    name = "short_stroke"
    equation = "u -> u"

    def input(self, m, u, p):
        return u


class Drift(SensorEffect):
    """A sensor that drifts."""

    name = "drift"
    equation = "y = x + drift"


def test_an_effect_that_does_not_say_what_a_record_shows_is_given_a_sentence():
    words = ("force", "displacement", "velocity")
    level, share = Shown(0.08, "N·m"), Shown(0.5, "-")
    assert LipSeal.shown({"mu": level}, *words) == "the residual force has the shape of lip seal, with mu = 0.08 N·m"
    both = LipSeal.shown({"mu": level, "a": share, "b": share}, *words)
    assert both.endswith(", with mu = 0.08 N·m, a = 0.5 and b = 0.5")
    assert ShortStroke.shown({}, *words) == "it shows short stroke"
    assert Drift.shown_on("speed", Shown(0.1, "rad/s")) == "the speed shows drift: 0.1 rad/s"
    assert Drift.shown_on("speed", share) == "the speed shows drift: 0.5"
