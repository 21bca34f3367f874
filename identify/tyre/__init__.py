"""Tyre models, their derivatives and their fits."""
