"""From a finished search to a verdict: drop-one tests, groups of rivals, caveats, detectability, summary."""
