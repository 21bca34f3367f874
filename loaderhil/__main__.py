"""`python -m loaderhil` is `loaderhil`."""

import os
import sys


def main() -> None:
    """Entry point: Ctrl-C ends in one line while the command line itself is still being loaded, too.

    Matrices are small here, and the threads of BLAS would only wait for one another, three times as long as the work takes. numpy,
    which is not loaded yet, reads the variable; what the user set stays.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from loaderhil.cli import main as command_line

        command_line()
    except KeyboardInterrupt:
        print("loaderhil: interrupted", file=sys.stderr)
        sys.exit(130)  # Ending.INTERRUPTED, which may not have been loaded


if __name__ == "__main__":
    main()
