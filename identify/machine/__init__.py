"""Masses, centres of gravity, inertias and zero points of a machine from drives and weighings."""
