"""Show that the generator's step is short enough: the same records at half the step, in units of their noise.

python -m benchmarks.hidden.check --count 48
"""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.hidden import generator, laws


def difference(group: str, index: int, seed: int, factor: float) -> float:
    """Return the largest difference between the step and ``factor`` times the step, in standard deviations of noise."""
    coarse = generator.draw(group, index, seed)
    step = laws.STEP
    laws.STEP = step * factor
    try:
        fine = generator.draw(group, index, seed)
    finally:
        laws.STEP = step
    worst = 0.0
    for name, sigma in coarse.truth["noise_sigma"]["estimation"].items():
        if coarse.truth["kind"] == "quantised" and name in generator.POSITION:
            continue  # a count flips where the motion differs by nothing
        worst = max(worst, float(np.abs(coarse.estimation[name] - fine.estimation[name]).max()) / sigma)
    return worst


def main() -> None:
    """Print the differences of a few groups."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=48)
    parser.add_argument("--seed", type=int, default=generator.DEVELOPMENT)
    arguments = parser.parse_args()
    for group in ("single", "outside", "springs", "signals", "similar"):
        found = [difference(group, k, arguments.seed, 0.5) for k in range(arguments.count)]
        over = sum(d > 0.01 for d in found)
        print(f"{group:8} median {np.median(found):.1e}, largest {max(found):.1e} sigma; over 0.01: {over}")
        for k in np.argsort(found)[::-1][:5]:
            print("    ", k, *generator.plan(group, int(k), arguments.seed).laws, f"{found[k]:.1e}")


if __name__ == "__main__":
    main()
