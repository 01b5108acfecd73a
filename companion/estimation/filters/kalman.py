"""Implements the steps of a linear Kalman filter with a scalar measurement.

Shapes: state x (n,), covariance P (n, n).
"""

import numpy as np

from companion.core.arrays import Array


def predicted(x: Array, p: Array, f: Array, q: Array) -> tuple[Array, Array]:
    """State and covariance after a step with the transition F (n, n) and noise Q (n, n).

    x' = F x
    P' = F P Fᵀ + Q
    """
    return np.dot(f, x), np.dot(np.dot(f, p), f.T) + q


def corrected(
    x: Array, p: Array, h: Array, measured: float, variance: float
) -> tuple[Array, Array]:
    """State and covariance after z = `measured` = hᵀ x + noise of variance r; h has shape (n,).

        s = hᵀ P h + r
        k = P h / s
        x' = x + k (z - hᵀ x)
        P' = (I - k hᵀ) P (I - k hᵀ)ᵀ + k r kᵀ

    The last line is the Joseph form. P stays symmetric and positive, also after rounding.
    """
    ph = np.dot(p, h)
    k = ph * (1 / (np.dot(h, ph) + variance))
    rest = np.eye(len(x)) - np.outer(k, h)
    corrected_p: Array = np.dot(np.dot(rest, p), rest.T) + np.outer(k * variance, k)
    return x + k * (measured - np.dot(h, x)), corrected_p
