"""The linearization's identities and limits, for any point; values are held in tests/independent."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from signlin_ros.errors import InputError
from signlin_ros.linearization import METHODS, Linearizer, linearize
from signlin_ros.model import Model
from signlin_ros.sign import sign_j

TABLE_1 = {"R_a": 0.764, "L_a": 0.0026, "K_t": 0.0805, "K_m": 0.0805, "B": 0.0, "J": 0.0022}
LOOP = {"alpha": 0.4, "D": 0.08, "lambda": 1.0, "beta": 0.6, "gamma": -0.35, "n": 2.0}
EFFECTS = {
    "coulomb_friction": {"mu": 0.033},
    "stribeck_friction": {"mu": 0.01, "excess": 0.02, "v_s": 2.0},
    "gravity_load": {"A": 0.08, "q0": 0.3},
    "constant_load": {"F0": 0.02},
    "quadratic_drag": {"c2": 6e-5},
    "input_deadzone": {"d": 0.9},
}


def model(plant="dc_motor", effects=None, **options):
    base = {"m": 1.0, "c": 0.6, "k": 40.0}
    parameters = {"dc_motor": TABLE_1, "mass_spring_damper": base, "bouc_wen": base | LOOP}[plant]
    return Model.from_dict({"plant": plant, "parameters": parameters, "effects": effects or {}, **options})


MODELS = {
    "motor": model(effects={"coulomb_friction": {"mu": 0.033}}),
    "everything": model(effects=EFFECTS, sign_scale=0.3, with_load_torque=True),
    "weights": model(effects=EFFECTS, state_weights={"position": 0.0, "current": 4.0}),
    "oscillator": model("mass_spring_damper", {"hard_stop": {"gap": 0.1, "k_s": 220.0}}, sign_scale=0.01),
    "bouc_wen": model("bouc_wen", sign_scale=0.1),
}
LINEARIZERS = {(name, method): Linearizer(m, method) for name, m in MODELS.items() for method in METHODS}
STATE = st.one_of(st.floats(-50, 50), st.sampled_from([0.0, 1.0, -1.0, 1e-14, -1e-14, 1e-300, 5e-324]))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", MODELS)
@given(x=st.lists(STATE, min_size=3, max_size=3), u=st.lists(STATE, min_size=2, max_size=2))
def test_the_linear_model_is_exact_at_its_point(name, method, x, u):
    linear = LINEARIZERS[name, method]
    r = linear(x[: linear.n], u[: linear.m])
    terms = np.abs(r.A) @ np.abs(r.x) + np.abs(r.B) @ np.abs(r.u) + np.abs(r.c)
    assert np.all(np.abs(r.A @ r.x + r.B @ r.u + r.c - r.f) <= 4e-14 * (terms + 1.0))
    assert np.isfinite(np.concatenate([r.A.ravel(), r.B.ravel(), r.c, r.f])).all()
    np.testing.assert_array_equal(r.x, x[: linear.n])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", MODELS)
def test_towards_0_A_becomes_the_jacobian(name, method):
    linear, jacobian = LINEARIZERS[name, method], LINEARIZERS[name, "jacobian"]
    u = np.full(linear.m, 0.5)
    want = jacobian(np.zeros(linear.n), u)
    np.testing.assert_allclose(linear(np.zeros(linear.n), u).A, want.A, rtol=1e-14, atol=1e-14)
    for size in (1e-9, 1e-100, 1e-300):
        near = linear(np.full(linear.n, size), u).A
        np.testing.assert_allclose(near, want.A, atol=1e-5 * np.abs(want.A).max())


@given(st.floats(-30, 30))
def test_the_papers_motor(w):
    """Eq. (33), Remark 2: K_f = mu sign_j(w)/w stands in the speed's own entry and nowhere else."""
    r = LINEARIZERS["motor", "termwise"]([0.4, w], [2.0])
    p = TABLE_1
    # where w underflows in mu sign_j(w)/w its limit is mu j
    friction = 0.033 * 50 if abs(w) < 1e-290 else 0.033 * float(sign_j(w, 50)) / w
    want = [[-p["R_a"] / p["L_a"], -p["K_m"] / p["L_a"]], [p["K_t"] / p["J"], -(p["B"] + friction) / p["J"]]]
    np.testing.assert_allclose(r.A, want, rtol=1e-12)
    np.testing.assert_allclose(r.B, [[1 / p["L_a"]], [0.0]], rtol=1e-14)
    np.testing.assert_allclose(r.c, 0.0, atol=1e-290)
    assert r.in_valid_range == (abs(w) <= 50 / 3)


@given(st.lists(st.floats(-20, 20).filter(lambda v: abs(v) > 1e-3), min_size=2, max_size=2))
def test_optimal_is_the_smallest_change_of_the_jacobian(x):
    """Teixeira and Zak: among all A with A x = f, row by row the one closest to the Jacobian."""
    a, j = LINEARIZERS["motor", "optimal"](x), LINEARIZERS["motor", "jacobian"](x)
    f = a.f - a.c
    want = j.A + np.outer(f - j.A @ a.x, a.x) / (a.x @ a.x)
    np.testing.assert_allclose(a.A, want, rtol=1e-9, atol=1e-9 * np.abs(want).max())
    np.testing.assert_array_equal(a.c, 0.0)


def test_a_state_without_weight_keeps_the_jacobians_column():
    x = [0.4, 5.0, 1.2]
    free, held = LINEARIZERS["weights", "optimal"](x), LINEARIZERS["weights", "jacobian"](x)
    np.testing.assert_array_equal(free.A[:, 2], held.A[:, 2])
    assert np.abs(free.A[1, :2] - held.A[1, :2]).min() > 0


def test_c_is_the_known_constant_of_loads():
    loaded = model(effects={"coulomb_friction": {"mu": 0.033}, "constant_load": {"F0": 0.02}})
    for method in ("optimal", "termwise"):
        np.testing.assert_allclose(linearize(loaded, [0.4, 5.0], method=method).c, [0.0, 0.02 / 0.0022])


def test_a_large_constant_costs_no_digit_near_0():
    """c = 10, v = 1e-14 would lose 3e-4 of A if f(0) were subtracted."""
    plain = model("mass_spring_damper", {"coulomb_friction": {"mu": 1.0}})
    loaded = model("mass_spring_damper", {"coulomb_friction": {"mu": 1.0}, "constant_load": {"F0": 10.0}})
    for method in METHODS:
        a, b = (linearize(m, [0.0, 1e-14], method=method) for m in (plain, loaded))
        np.testing.assert_allclose(b.A, a.A, rtol=1e-13)


def test_an_input_that_is_not_affine_enters_at_its_point():
    dead = model(effects={"input_deadzone": {"d": 0.9}}, sign_scale=0.3)
    inside, outside = linearize(dead, [0.0, 0.0], [0.3]), linearize(dead, [0.0, 0.0], [2.0])
    assert abs(inside.B[0, 0]) < 1e-3 * outside.B[0, 0]
    np.testing.assert_allclose(outside.B @ [2.0] + outside.c, [1.1 / TABLE_1["L_a"], 0.0], rtol=1e-3)


def test_delay_is_reported_beside_the_model():
    late = model(effects={"input_delay": {"T": 0.004}})
    assert linearize(late, [0.0, 0.0]).delay == 0.004
    assert linearize(MODELS["motor"], [0.0, 0.0]).delay == 0.0


def test_the_batch_agrees_with_single_calls():
    rng = np.random.default_rng(0)
    for (name, method), linear in LINEARIZERS.items():
        X, U = rng.normal(0, 3, (40, linear.n)), rng.normal(0, 2, (40, linear.m))
        batch = linear.batch(X, U)
        assert batch.A.shape == (40, linear.n, linear.n)
        assert batch.B.shape == (40, linear.n, linear.m)
        for k in range(0, 40, 7):
            one = linear(X[k], U[k])
            for field in ("A", "B", "c", "f"):
                np.testing.assert_allclose(
                    getattr(batch, field)[k],
                    getattr(one, field),
                    rtol=1e-11,
                    atol=1e-12,
                    err_msg=f"{name} {method}",
                )


def test_results_do_not_share_memory():
    linear = LINEARIZERS["motor", "termwise"]
    first = linear([0.4, 5.0])
    kept = first.A.copy()
    linear([0.1, -9.0])
    np.testing.assert_array_equal(first.A, kept)


@pytest.mark.parametrize("x", [[1.0], [1.0, 2.0, 3.0], [np.nan, 0.0], [0.0, np.inf], ["a", 0.0]])
def test_bad_points_are_refused(x):
    with pytest.raises(InputError):
        LINEARIZERS["motor", "termwise"](x)


@pytest.mark.parametrize("u", [[np.nan], [1.0, 2.0], [np.inf]])
def test_bad_inputs_are_refused(u):
    with pytest.raises(InputError):
        LINEARIZERS["motor", "termwise"]([0.0, 0.0], u)


def test_after_a_refusal_the_next_call_is_right():
    linear = LINEARIZERS["motor", "termwise"]
    want = linear([0.4, 5.0], [1.0]).A
    for bad in ([np.nan, 0.0], [1.0]):
        with pytest.raises(InputError):
            linear(bad)
    np.testing.assert_array_equal(linear([0.4, 5.0], [1.0]).A, want)


def test_an_unknown_method_names_the_nearest():
    with pytest.raises(InputError, match="did you mean 'optimal'"):
        Linearizer(MODELS["motor"], "optimum")


def test_batch_shapes_are_checked():
    with pytest.raises(InputError, match=r"\(T, 2\)"):
        LINEARIZERS["motor", "termwise"].batch(np.zeros((4, 3)))


def test_a_linearization_shows_itself_as_a_table():
    shown = linearize(model(), [0.3, 5.0], [2.0])._repr_html_()
    for words in ("<tr><th>A</th><th></th><th>B</th><th>c</th></tr>", "termwise", "inside the valid range", "-293.85"):
        assert words in shown
