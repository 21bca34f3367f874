"""`python -m hil` is `loaderhil`."""

import sys


def main() -> None:
    """Entry point: Ctrl-C ends in one line while the command line itself is still being loaded, too."""
    try:
        from hil.cli import main as command_line

        command_line()
    except KeyboardInterrupt:
        print("loaderhil: interrupted", file=sys.stderr)
        sys.exit(130)  # Ending.INTERRUPTED, which may not have been loaded


if __name__ == "__main__":
    main()
