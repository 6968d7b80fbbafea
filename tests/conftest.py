"""Settings that hold for every test."""

import os

# Before numpy loads its BLAS: waiting threads make small problems many times slower, and timings meaningless.
for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"
# No test may open a window.
os.environ["MPLBACKEND"] = "Agg"

from hypothesis import settings  # noqa: E402

# The same examples on every run, and no verdict that depends on how busy the machine is.
settings.register_profile("house", deadline=None, derandomize=True, database=None)
settings.load_profile("house")
