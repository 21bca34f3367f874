"""The next experiment: which manoeuvre distinguishes best what the recordings cannot, driven on the bench until one name is left."""
