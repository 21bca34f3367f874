"""BLAS gets one thread, as in `loaderhil` itself (loaderhil.__main__): said here, before numpy is loaded."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
