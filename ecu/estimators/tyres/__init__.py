"""Tyre laws, contact points and the slip of each wheel."""
