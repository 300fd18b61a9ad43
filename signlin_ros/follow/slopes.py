"""The slope of a model under the set-valued law, and its derivatives: compiled parts of `signlin_ros.follow.loop`."""

# Numba infers the types in here; mypy cannot see through its decorators. What is literal (1, 0, True) is a type of its
# own, for which a function is compiled once more: hence np.int64(1).
# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="misc,call-arg,unreachable"

from __future__ import annotations

from signlin_ros.engine.compiling import call, copied, inlined, inner


@inner
def evaluated(address, sizes, z, out, mode, s):
    """Evaluate F at z under the mode (0 stuck, else slipping with s); returns the sign in force (1: no surface)."""
    n, switched = sizes[0], sizes[5]
    if not switched:
        call(address, z, out)
        return 1.0
    last = z.size - 1
    if mode != 0:
        z[last] = s
        call(address, z, out)
        return s
    z[last] = 0.0
    call(address, z, out)
    stuck = -out[n + 1] / out[2 * n + 2]
    for i in range(n):
        out[i] += out[n + 2 + i] * stuck
    out[n + 1] = 0.0
    return stuck


@inner
def choose(head, sizes, z, out):
    """Decide at a surface by the set-valued law: returns (mode, s)."""
    n = sizes[0]
    z[z.size - 1] = 0.0
    call(head, z, out)
    rate, coupling = out[n + 1], out[2 * n + 2]
    if coupling < 0.0 and abs(rate) <= -coupling:
        return 0, 0.0
    return 1, (1.0 if rate > 0.0 else -1.0)


@inner
def linearized(code, sizes, z, out, mode, s):
    """Leave in out the derivatives of F in force at z, and F itself."""
    stuck = evaluated(code[1], sizes, z, out, mode, s)
    if mode == 0 and sizes[5]:
        z[z.size - 1] = stuck
        call(code[1], z, out)
        n, ny, at, width = sizes[0], sizes[2], sizes[10], sizes[11]
        at_x, at_p = 2 * n + 3 + ny + ny * n, at + n * n + n * width
        coupling = out[2 * n + 2]
        for i in range(n):
            gain = out[n + 2 + i] / coupling
            if gain != 0.0:
                for j in range(n):
                    out[at + i * n + j] -= gain * out[at_x + j]
                for j in range(width):
                    out[at + n * n + i * width + j] -= gain * out[at_p + j]
        out[n + 1] = 0.0
    return stuck


@inner
def differentiated(code, sizes, z, out, mode, s):
    """Leave in out dF/dx in force at z, and F itself, but not always the derivatives to parameters."""
    if mode == 0 and sizes[5]:
        linearized(code, sizes, z, out, mode, s)
    else:
        evaluated(code[8], sizes, z, out, mode, s)


@inner
def keep(sizes, out, kept):
    """Copy the derivatives of F (n, n) and (n, w) from out."""
    copied(out, sizes[10], kept)


@inlined
def settle(code, sizes, z, out, mode, s, moved):
    """Choose mode and sign anew after the input or, if ``moved``, the state has jumped; returns (mode, s).

    Leaves in ``out`` all of z under that sign, or if stuck under the one that holds the motion.
    """
    head = code[0]
    if not sizes[5]:
        mode, s = 1, 1.0
    elif mode == 0 and not moved:
        mode, s = choose(head, sizes, z, out)
    else:
        z[z.size - 1] = s
        call(code[1], z, out)
        g = out[sizes[0]]
        if g * s > 0.0:
            return 1, s
        if g == 0.0:
            mode, s = choose(head, sizes, z, out)
        else:
            mode, s = 1, (1.0 if g > 0.0 else -1.0)
    z[z.size - 1] = s
    if mode == 0:
        z[z.size - 1] = evaluated(head, sizes, z, out, mode, s)
    call(code[1], z, out)
    return mode, s


__all__ = ["choose", "differentiated", "evaluated", "keep", "linearized", "settle"]
