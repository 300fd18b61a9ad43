"""Functions that Numba compiles once per machine, and how they call machine code by its address."""

# Numba and llvmlite carry no types.
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc"

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.dispatcher import Dispatcher
from numba.core.errors import TypingError
from numba.extending import intrinsic

_POINTER = ir.DoubleType().as_pointer()
_FUNCTION = ir.FunctionType(ir.VoidType(), [_POINTER, _POINTER])
_AMONG = ir.FunctionType(ir.VoidType(), [_POINTER] * 4)


def _check(*arrays: Any) -> None:
    for array in arrays:
        if not (isinstance(array, types.Array) and array.dtype == types.float64 and array.layout == "C"):
            raise TypingError(f"native code works on contiguous arrays of float64; found {array}")


def _data(context: Any, builder: Any, kind: Any, array: Any) -> Any:
    """Write the pointer to an array's first number."""
    return builder.bitcast(context.make_array(kind)(context, builder, array).data, _POINTER)


def _call(typing_context: Any, address: Any, inputs: Any, results: Any) -> Any:
    _check(inputs, results)
    signature = types.void(types.intp, inputs, results)

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        target = builder.inttoptr(arguments[0], _FUNCTION.as_pointer())
        builder.call(target, [_data(context, builder, sig.args[i], arguments[i]) for i in (1, 2)])
        return context.get_dummy_value()

    return signature, generate


def _call_within(typing_context: Any, address: Any, work: Any, first_input: Any, first_result: Any) -> Any:
    _check(work)
    signature = types.void(types.intp, work, types.intp, types.intp)

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        target = builder.inttoptr(arguments[0], _FUNCTION.as_pointer())
        data = _data(context, builder, sig.args[1], arguments[1])
        builder.call(target, [builder.gep(data, [arguments[i]]) for i in (2, 3)])
        return context.get_dummy_value()

    return signature, generate


def _call_among(typing_context: Any, address: Any, first: Any, last: Any, at: Any, S: Any, step: Any) -> Any:
    _check(first, last, S, step)
    signature = types.void(types.intp, first, last, types.intp, S, step)

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        target = builder.inttoptr(arguments[0], _AMONG.as_pointer())
        data = {i: _data(context, builder, sig.args[i], arguments[i]) for i in (1, 2, 4, 5)}
        data[2] = builder.gep(data[2], [arguments[3]])
        builder.call(target, list(data.values()))
        return context.get_dummy_value()

    return signature, generate


def _copy(typing_context: Any, source: Any, at: Any, to: Any) -> Any:
    _check(source, to)
    signature = types.void(source, types.intp, to)

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        place = context.make_array(sig.args[2])(context, builder, arguments[2])
        data = builder.gep(_data(context, builder, sig.args[0], arguments[0]), [arguments[1]])
        cgutils.raw_memcpy(builder, builder.bitcast(place.data, _POINTER), data, place.nitems, 8)
        return context.get_dummy_value()

    return signature, generate


call: Any = intrinsic(_call)
"""``call(address, inputs, results)`` calls native code, from a compiled function, with two arrays of float64."""
call_among: Any = intrinsic(_call_among)
"""``call_among(address, a, b, i, c, d)``: the same with four arrays, of which the second counts from ``b[i]`` on."""
copied: Any = intrinsic(_copy)
"""``copied(a, i, b)`` fills all of the array b with what stands in a from ``a[i]`` on."""
call_within: Any = intrinsic(_call_within)
"""``call_within(address, work, i, k)``: the same with inputs from ``work[i]`` on and results from ``work[k]`` on."""
_stamps: dict[str, set[str]] = {}
"""By module: what tells the versions of all files apart that its compiled functions are made of."""


def _compiling(**options: Any) -> Any:
    """Return a decorator that compiles a function and keeps it on disk until its file, or that of a part, changes.

    Of the parts, Numba itself does not look: a function would be used on with what they were before.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        found = numba.njit(cache=True, error_model="numpy", nogil=True, **options)(function)
        if isinstance(found, Dispatcher):
            _stamp(found, function)
        return found

    return decorate


def _stamp(found: Any, function: Callable[..., Any]) -> None:
    """Let what is kept of a compiled function know the files of its parts."""
    file = found._cache._cache_file
    stamps = _stamps.setdefault(function.__module__, {repr(file._source_stamp)})
    parts = (part for part in function.__globals__.values() if isinstance(part, Dispatcher))
    stamps.update(*(_stamps.get(part.py_func.__module__, ()) for part in parts))
    file._source_stamp = sorted(stamps)


# Caches know nothing of these options: after a change, delete them.
compiled: Any = _compiling()
"""Compiled once per machine: a function that makes the arrays in which others work."""
inner: Any = _compiling(_nrt=False)
"""The same for what works in arrays that it is given: references to them are not counted, which would cost more than
what small functions do. They make no arrays, nor assign to slices.
"""
inlined: Any = _compiling(inline="always", _nrt=False)
"""The same, written out wherever it is called: to hand over a dozen arrays may take as long as what is done to them."""


def caller(address: int) -> Callable[[np.ndarray, np.ndarray], None]:
    """Return a Python function that fills ``results`` from ``inputs``; for tests."""
    return lambda inputs, results: _call_once(address, inputs, results)


@compiled
def _call_once(address, inputs, results):
    call(address, inputs, results)


__all__ = ["call", "call_among", "call_within", "caller", "compiled", "copied", "inlined", "inner"]
