"""Two runs side by side: estimates, states, warnings and timing, each within a tolerance."""
