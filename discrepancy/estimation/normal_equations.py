"""Inverses of normal matrices whose parameters have very different units.

Pascals beside metres are eight powers of ten apart, and sixteen in the matrix: a plain pseudo-inverse takes the smaller for rounding.
"""

import numpy as np
from numpy.typing import NDArray

from discrepancy.signals.recording import Array

# Relative size of an eigenvalue, of a matrix with ones on its diagonal, below which it is rounding: columns are finite differences
# with some five correct digits, and their squares stand in the matrix.
ROUNDING = 1e-10


def inverse(normal: Array, whole: Array | None = None) -> Array:
    """Pseudo-inverse (k, k) of a normal matrix (k, k), scaled by the information on each parameter.

    A parameter without information gets a variance of zero, so it stays where it is. whole: the larger matrix of which this one remains after
    a projection, if any; a diagonal element that is only rounding of the original one then counts as zero.
    """
    # as a product of a root with its transpose: no variance can become negative by rounding
    half = root(normal, whole)
    return np.asarray(half @ half.T, float)


def root(normal: Array, whole: Array | None = None) -> Array:
    """The root (k, m) of the pseudo-inverse: its columns are the determined directions, each with the length of one standard deviation."""
    by_size, sizes, directions, kept = _spectrum(normal, whole)
    return np.asarray(by_size[:, None] * directions[:, kept] / np.sqrt(sizes[kept]), float)


def undetermined(normal: Array) -> Array:
    """The directions (k, m) that the inverse leaves out because nothing is known of them but rounding, of length 1 in scaled parameters."""
    _, _, directions, kept = _spectrum(normal, None)
    return np.asarray(directions[:, ~kept], float)


def _spectrum(normal: Array, whole: Array | None) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Scale of each parameter (k,), eigenvalues (k,) and directions (k, k) of the scaled matrix, and which of them are more than rounding."""
    known = np.diag(normal)
    known = np.where(known > ROUNDING * (known if whole is None else np.diag(whole)), known, 0.0)
    by_size = np.where(known > 0.0, 1.0 / np.sqrt(np.where(known > 0.0, known, 1.0)), 0.0)
    sizes, directions = np.linalg.eigh(np.outer(by_size, by_size) * normal)
    return by_size, sizes, directions, sizes > ROUNDING * np.max(sizes, initial=0.0)
