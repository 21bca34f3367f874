"""Pass criteria of a run: the [[expect]] tables of a scenario, judged on its run directory."""
