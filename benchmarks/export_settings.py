"""What an exported file costs and what its settings are worth: python -m benchmarks.export_settings.

Processor time of a linearization of the paper's motor in exported C; the error of a stiff LuGre friction in MuJoCo by
integrator and time step.
"""

import ctypes
import tempfile
from pathlib import Path

import numpy as np

from signlin_ros.export import export
from signlin_ros.export.compiler import build
from signlin_ros.export.excitation import standard_excitation
from signlin_ros.export.loss import reference
from signlin_ros.export.matrix import bench
from signlin_ros.export.mjcf import INTEGRATORS, parts_of
from signlin_ros.export.mjcf_parts import Setting, document
from signlin_ros.export.mjcf_run import run
from signlin_ros.model import Model

COUNT = 5_000_000
LOOP = """#include <time.h>
#include "motor.h"
double spent(long count, double *sum);
double spent(long count, double *sum)
{
    double x[motor_N] = {0.4, 20.0}, u[motor_M] = {2.0}, A[motor_N * motor_N], B[motor_N * motor_M], c[motor_N];
    const clock_t begun = clock();
    long k;
    for (k = 0; k < count; k++) {
        x[1] = 20.0 - 8e-6 * (double)k;
        motor_linearize(x, u, A, B, c);
        *sum += A[3] + c[1];
    }
    return (double)(clock() - begun) / CLOCKS_PER_SEC;
}
"""
STIFF = {"sigma0": 1000.0, "sigma1": 1.0, "sigma2": 0.001, "F_c": 0.033, "F_s": 0.05, "v_s": 0.5}
STEPS = (5e-3, 2e-3, 1e-3, 5e-4, 1e-4)


def microseconds() -> float:
    """Processor time in µs of one call of motor_linearize, compiled with -O2."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        export(Model.load("dc_motor"), "c", folder / "motor.c")
        (folder / "loop.c").write_text(LOOP)
        build([folder / "motor.c", folder / "loop.c"], folder / "loop.so")
        spent = ctypes.CDLL(str(folder / "loop.so")).spent
        spent.restype = ctypes.c_double
        return min(1e6 * spent(ctypes.c_long(COUNT), ctypes.byref(ctypes.c_double())) / COUNT for _ in range(3))


def trap() -> list[str]:
    """The error of the speed in percent of its RMS, a row for each time step."""
    model = bench().with_effect("lugre_friction", **STIFF)
    drive = standard_excitation(model)
    speed = reference(model, drive)["speed"]
    parts = parts_of(model, 1.0, 1.0)
    lines = [f"| time step in ms | {' | '.join(INTEGRATORS)} |", "|---:|" + "---:|" * len(INTEGRATORS)]
    for step in STEPS:
        row = []
        for integrator in INTEGRATORS:
            found = run(document("trap", parts, Setting(integrator, step), []), parts, model, drive)["speed"]
            with np.errstate(all="ignore"):
                error = 100 * np.sqrt(np.mean((found - speed) ** 2) / np.mean(speed**2))
            row.append(f"{error:.2g}" if np.isfinite(error) and error < 1e3 else "diverges")
        lines.append(f"| {1000 * step:g} | {' | '.join(row)} |")
    return lines


if __name__ == "__main__":
    print(f"one linearization of the paper's motor in C: {microseconds():.3f} µs")
    print("\n".join(trap()))
