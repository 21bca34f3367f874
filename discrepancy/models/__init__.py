"""Models that come with loaderhil: each is a description, a function, and a library of effects that may be missing."""
