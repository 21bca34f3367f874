"""Mutated files and packets for every reader: a few in the tests, 10^5 files by `make fuzz`."""
