"""Are the expectations worth anything? Runs them against faults and planted ECU errors, and lists what nobody noticed."""
