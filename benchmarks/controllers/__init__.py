"""Controllers beside one another on simulated plants: ``python -m benchmarks.controllers.table``."""

import os

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):  # matrices of 3 x 3: threads only wait for one another
    os.environ.setdefault(_name, "1")
