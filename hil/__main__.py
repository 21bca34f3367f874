"""`python -m hil` is `loaderhil`."""

from hil.cli import main

main()
