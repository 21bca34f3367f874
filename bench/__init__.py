"""Benchmarks and the proof, for developers; each module is run by `python -m bench.NAME`."""

import os

# one BLAS thread, as in `loaderhil` itself (loaderhil.__main__); set here, before numpy reads it
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
