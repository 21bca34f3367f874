"""Normal matrices of parameters, whatever their units: pascals stand beside metres, eight powers of ten apart, sixteen in the matrix."""

import numpy as np

from discrepancy.recording import Array

ROUNDING = 1e-10  # eigenvalue of a matrix with ones on its diagonal, below which only rounding tells parameters apart


def inverse(normal: Array, whole: Array | None = None) -> Array:
    """Pseudo-inverse (k, k) of a normal matrix (k, k), each parameter measured by what is known of it.

    What nothing tells stays where it is; a plain pseudo-inverse would also drop parameters of large units. Eigenvalues that rounding left
    below zero tell nothing either, so that no variance is negative. whole: the matrix of which
    this is a part, if it is one: what is left of a parameter may be no more than rounding.
    """
    known = np.diag(normal)
    known = np.where(known > ROUNDING * (known if whole is None else np.diag(whole)), known, 0.0)
    by_size = np.where(known > 0.0, 1.0 / np.sqrt(np.where(known > 0.0, known, 1.0)), 0.0)
    even = np.outer(by_size, by_size)
    told, directions = np.linalg.eigh(even * normal)
    kept = told > ROUNDING * np.max(told, initial=0.0)
    return np.asarray(even * (directions[:, kept] / told[kept] @ directions[:, kept].T), float)
