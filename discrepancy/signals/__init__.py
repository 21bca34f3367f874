"""Plain data of the engine: recordings, units, quantities, findings."""
