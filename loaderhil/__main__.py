"""`python -m loaderhil` is `loaderhil`."""

import os
import sys


def main() -> None:
    """Entry point: Ctrl-C ends in one line, also while the command line itself is still being loaded."""
    # Matrices are small here: the threads of BLAS would wait for one another three times as long as the work takes.
    # numpy reads the variable when it is loaded, which is later; a value that the user set stays.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # inside the try: on a slow disk the imports take long enough for somebody to press Ctrl-C
    try:
        from loaderhil.cli import main as command_line

        command_line()
    except KeyboardInterrupt:
        print("loaderhil: interrupted", file=sys.stderr)
        sys.exit(130)  # Ending.INTERRUPTED, which may not have been loaded


if __name__ == "__main__":
    main()
