"""What the sizes of effects are known to be: which would show at all, and intervals where the likelihood is flat."""
