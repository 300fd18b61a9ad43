"""A_k, B_k and c at an operating point: the optimal, the termwise and the Jacobian linearization.

All three satisfy A x_k + B u_k + c = F_j(x_k, u_k). Sources: Teixeira and Zak, Stabilizing controller design for
uncertain nonlinear systems using fuzzy models, IEEE Trans. Fuzzy Systems 7 (1999), doi:10.1109/91.755395; paper
eqs. (26)-(27) (`optimal`) and (33) with Remark 2 (`termwise`). c is the known constant f(0) of loads, gravity and
direction-dependent terms, which (26) leaves out.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from signlin_ros.compiled import linear_function, linear_tape, scales, weights
from signlin_ros.errors import InputError, choices, suggest
from signlin_ros.markup import html_table
from signlin_ros.model import ARM_METHODS, METHODS, Model

Array = NDArray[np.float64]
_FALSE = np.False_.tobytes()  # searching bytes is several times quicker than ndarray.all() on a few numbers


class Linearization(NamedTuple):
    """x' = A x + B u + c near the operating point (x, u), where it gives f exactly.

    A (n, n), B (n, m), c (n,), x (n,), u (m,), f (n,) = F_j(x, u); ``method``; ``in_valid_range`` of sign_j;
    ``delay`` of the input in s, which is not in A, B.
    """

    A: Array
    B: Array
    c: Array
    x: Array
    u: Array
    f: Array
    method: str
    in_valid_range: bool
    delay: float

    def _repr_html_(self) -> str:
        values = [f"{'inside' if self.in_valid_range else 'outside'} the valid range"]
        values += [f"{name} = {np.array2string(getattr(self, name), precision=4)}" for name in ("x", "u", "f")]
        n, m = self.B.shape
        head = [*["A", *[""] * (n - 1)][:n], *["B", *[""] * (m - 1)][:m], "c"]
        rows = np.column_stack([self.A, self.B, self.c])
        above = f"x' = A x + B u + c, {self.method}, {', '.join(values)}"
        return html_table(head, [[f"{value:.5g}" for value in row] for row in rows], above)


class LinearizationBatch(NamedTuple):
    """Linearizations at T operating points: A (T, n, n), B (T, n, m), c, f (T, n), in_valid_range (T,)."""

    A: Array
    B: Array
    c: Array
    x: Array
    u: Array
    f: Array
    in_valid_range: NDArray[np.bool_]


class Linearizer:
    """A model's linearization, ready for fast calls: everything symbolic is done here, once.

    Raises `InputError` for an unknown method. ``operating_point: midpoint`` first carries the state half an update
    period forward with the nonlinear f_j and the input held, and reports that point as x.
    """

    def __init__(self, model: Model, method: str | None = None) -> None:
        method = method or model.linearization
        known = ARM_METHODS if model.plant.name == "arm" else METHODS
        if method not in known:
            of = f" for the plant {model.plant.name}" if method in (*ARM_METHODS, *METHODS) else ""
            raise InputError(f"method {method!r}; known{of}: {choices(known)}{suggest(method, known)}")
        self.model, self.method, self.delay = model, method, model.delay
        self.n, self.m = len(model.states), len(model.inputs)
        self._u0 = model.u0
        self.scales, self.weights = scales(model), weights(model)
        self._function, self._rows = linear_function(model.structure, model.sign_order, method)
        self._buffer, self._evaluate = self._function.buffer()
        size = self._rows["valid"].stop
        self._values = np.zeros(size + self.n + self.m)
        self._out, self._x, self._u = np.split(self._values, [size, size + self.n])
        self._good = np.ones(self._values.size, dtype=bool)
        self._constants = [np.array(v, dtype=float) for v in (model.p, self.scales, self.weights)]
        for i, array in enumerate((self._x, self._u, *self._constants)):
            self._buffer.set_arg(i, memoryview(array))  # type: ignore[call-arg, arg-type]
        self._buffer.set_res(0, memoryview(self._out))  # type: ignore[call-arg, arg-type]
        r = self._rows
        self._cuts = (r["A"].stop, r["B"].stop, r["c"].stop, r["f"].stop)
        self._many: Callable[[Array, Array, Array], None] | None = None
        self._middle = self._midpoint() if model.operating_point == "midpoint" else None

    def _midpoint(self) -> object:
        from signlin_ros.simulation import SmoothFlow

        return SmoothFlow(self.model, self.model.update_period / 2)

    def __call__(self, x: ArrayLike, u: ArrayLike | None = None) -> Linearization:
        """Linearize at x (n,) and u (m,), `Model.u0` if not given; raise `InputError` on wrong lengths or numbers."""
        try:
            fits = len(x) == self.n and (u is None or len(u) == self.m)  # type: ignore[arg-type]
            self._x[:] = x
            self._u[:] = self._u0 if u is None else u
        except (ValueError, TypeError) as error:
            raise InputError(f"x needs {self.n} numbers and u {self.m}: {error}") from error
        if not fits:
            raise InputError(f"x needs {self.n} numbers and u {self.m}; found {x!r} and {u!r}")
        if self._middle is not None and np.isfinite(self._x).all() and np.isfinite(self._u).all():
            self._x[:] = self._middle(self._x, self._u)  # type: ignore[operator]
        self._evaluate()
        if _FALSE in np.isfinite(self._values, self._good).tobytes():
            raise InputError(f"no finite linear model at x = {self._x.tolist()}, u = {self._u.tolist()}")
        out = self._out.copy()
        a, b, c, f = self._cuts
        A, B = out[:a].reshape(self.n, self.n), out[a:b].reshape(self.n, self.m)
        valid = bool(out[-1])
        return Linearization(A, B, out[b:c], self._x.copy(), self._u.copy(), out[c:f], self.method, valid, self.delay)

    def batch(self, x: ArrayLike, u: ArrayLike | None = None) -> LinearizationBatch:
        """Linearize at T points: x (T, n), u (T, m) or None for `Model.u0`; entries may be non-finite where x is."""
        points = np.ascontiguousarray(np.atleast_2d(np.asarray(x, dtype=float)))
        inputs = np.tile(self._u0, (len(points), 1)) if u is None else np.asarray(u, dtype=float).reshape(-1, self.m)
        if points.shape[1] != self.n or len(inputs) != len(points):
            raise InputError(
                f"x needs the shape (T, {self.n}) and u (T, {self.m}); found {points.shape}, {inputs.shape}"
            )
        if self._middle is not None:
            points = self._middle.many(points, inputs)  # type: ignore[attr-defined]
        flat = np.empty((len(points), self._out.size))
        if self._many is None:
            self._many = self._compiled()
        self._many(points, np.ascontiguousarray(inputs), flat)
        blocks = {name: flat[:, r.start : r.stop].reshape(len(points), *r.shape) for name, r in self._rows.items()}
        valid = blocks["valid"].astype(bool)
        return LinearizationBatch(blocks["A"], blocks["B"], blocks["c"], points, inputs, blocks["f"], valid)

    def _compiled(self) -> Callable[[Array, Array, Array], None]:
        """Return a function that fills results (T, ...) from x (T, n) and u (T, m), compiled only when it is needed."""
        from signlin_ros.engine.wide import at_points

        tape, _ = linear_tape(self.model.structure, self.model.sign_order, self.method)
        return at_points(tape, (self.n, self.m), np.concatenate(self._constants))


def linearize(model: Model, x: ArrayLike, u: ArrayLike | None = None, method: str | None = None) -> Linearization:
    """Return x' = A x + B u + c of a model at an operating point.   [paper eqs. (26), (27), (33)]

    Parameters
    ----------
    model : Model
        The model; a `Linearizer` of it serves repeated calls.
    x : array_like (n,)
        State in the model's units.
    u : array_like (m,), optional
        Input, `Model.u0` if not given.
    method : str, optional
        ``optimal``, ``termwise`` or ``jacobian``; by default the model's.

    Returns
    -------
    Linearization
        A (n, n), B (n, m), c (n,), the point x, u, f(x, u), ``in_valid_range`` and the input's ``delay`` in s.

    Raises
    ------
    InputError
        Wrong lengths, numbers that are not finite, or an unknown method.

    Examples
    --------
    >>> from signlin_ros import Model, linearize
    >>> linearize(Model.load("dc_motor"), [0.4, 10.0]).A.shape
    (2, 2)
    """
    return Linearizer(model, method)(x, u)
