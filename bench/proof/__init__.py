"""The proof of the discrepancy engine: every arm of the benchmark, seeded, its failures listed; `make proof`."""
