"""Normal matrices of parameters, whatever their units: pascals stand beside metres, eight powers of ten apart, sixteen in the matrix."""

import numpy as np

from discrepancy.recording import Array

ROUNDING = 1e-10  # eigenvalue of a matrix with ones on its diagonal, below which only rounding tells parameters apart


def inverse(normal: Array, whole: Array | None = None) -> Array:
    """Pseudo-inverse (k, k) of a normal matrix (k, k), each parameter measured by what is known of it.

    What nothing tells stays where it is; a plain pseudo-inverse would also drop parameters of large units. whole: the matrix of which
    this is a part, if it is one: what is left of a parameter may be no more than rounding.
    """
    known = np.diag(normal)
    known = np.where(known > ROUNDING * (known if whole is None else np.diag(whole)), known, 0.0)
    by_size = np.where(known > 0.0, 1.0 / np.sqrt(np.where(known > 0.0, known, 1.0)), 0.0)
    even = np.outer(by_size, by_size)
    return np.asarray(even * np.linalg.pinv(even * normal, rcond=ROUNDING, hermitian=True), float)
