"""A recording sent again: on a bus at its own times, or into the virtual ECU to compare its answers."""
