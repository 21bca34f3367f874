"""Normal matrices of parameters, whatever their units: pascals stand beside metres, eight powers of ten apart, sixteen in the matrix."""

import numpy as np

from discrepancy.signals.recording import Array

ROUNDING = 1e-10  # eigenvalue of a matrix with ones on its diagonal, below which there is only rounding


def inverse(normal: Array, whole: Array | None = None) -> Array:
    """Pseudo-inverse (k, k) of a normal matrix (k, k), scaled by the information on each parameter.

    A parameter without information stays where it is; a plain pseudo-inverse would also drop parameters of large units. Eigenvalues that
    rounding left below zero hold no information either, so that no variance is negative. whole: the matrix of which this is a part, if it
    is one, because the rest of a parameter in it may be no more than rounding.
    """
    half = root(normal, whole)
    return np.asarray(half @ half.T, float)


def root(normal: Array, whole: Array | None = None) -> Array:
    """(k, m) that times its transpose is the inverse: columns are the directions of which something is known, in their standard deviations."""
    known = np.diag(normal)
    known = np.where(known > ROUNDING * (known if whole is None else np.diag(whole)), known, 0.0)
    by_size = np.where(known > 0.0, 1.0 / np.sqrt(np.where(known > 0.0, known, 1.0)), 0.0)
    sizes, directions = np.linalg.eigh(np.outer(by_size, by_size) * normal)
    kept = sizes > ROUNDING * np.max(sizes, initial=0.0)
    return np.asarray(by_size[:, None] * directions[:, kept] / np.sqrt(sizes[kept]), float)
