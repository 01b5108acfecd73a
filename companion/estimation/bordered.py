"""Least squares over a chain of poses and a few unknowns that everything shares.

A residual touches one pose or two neighbours, and some of the shared unknowns; so the normal
equations are a narrow band with a border,

    [ A   B ] [ x ]     [ a ]        A: band, poses        x: step of the poses
    [ Bᵀ  C ] [ y ] = - [ b ]        C: small and full     y: step of the shared unknowns

With the Cholesky factor of A, the Schur complement S = C - Bᵀ A⁻¹ B gives y, and y gives x. S⁻¹ is
the covariance of the shared unknowns with the poses integrated out. Time and memory grow with the
length of the chain, not with its square.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded

Array = NDArray[np.float64]
Columns = NDArray[np.int64]
Gradient = Sequence[tuple[Columns | int, Array]]
"""Of n residuals: columns, (n,) or one for all, and the derivatives by those unknowns, (n,)."""


class Sums:
    """Numbers added up by place, all at once."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._places: list[Columns] = []
        self._values: list[Array] = []

    def add(self, place: Columns | int, value: Array) -> None:
        self._places.append(np.broadcast_to(place, value.shape))
        self._values.append(value)

    def total(self) -> Array:
        """(size,)."""
        if not self._places:
            return np.zeros(self._size)
        places, values = np.concatenate(self._places), np.concatenate(self._values)
        return np.bincount(places, values, self._size).astype(np.float64)


class BorderedSystem:
    """Normal equations being collected, row by row of the Jacobian."""

    def __init__(self, chained: int, shared: int, bandwidth: int) -> None:
        """Of so many unknowns in the chain, of which those within `bandwidth` may be coupled."""
        self._chained, self._shared, self._band = chained, shared, bandwidth
        self._a = Sums(bandwidth * chained)
        self._b = Sums(chained * shared)
        self._c = Sums(shared * shared)
        self._chain_gradient = Sums(chained)
        self._shared_gradient = Sums(shared)

    def add(
        self, residual: Array, sigma: Array | float, chained: Gradient, shared: Gradient = ()
    ) -> None:
        """Residuals (n,), their sigmas, and their gradients."""
        weight = np.broadcast_to(1 / np.square(sigma), residual.shape)
        for i, (row, by_row) in enumerate(chained):
            weighted = weight * by_row
            self._chain_gradient.add(row, weighted * residual)
            for column, by_column in chained[: i + 1]:
                low, high = np.minimum(row, column), np.maximum(row, column)
                self._a.add((high - low) * self._chained + low, weighted * by_column)
            for column, by_column in shared:
                self._b.add(row * self._shared + column, weighted * by_column)
        for row, by_row in shared:
            weighted = weight * by_row
            self._shared_gradient.add(row, weighted * residual)
            for column, by_column in shared:
                self._c.add(row * self._shared + column, weighted * by_column)

    def solve(self) -> "Solution":
        """The Gauss-Newton step, and what is known of its exactness."""
        a = cholesky_banded(self._a.total().reshape(self._band, self._chained), lower=True)
        b = self._b.total().reshape(self._chained, self._shared)
        right = np.column_stack([b, self._chain_gradient.total()])
        solved = cho_solve_banded((a, True), right)
        a_inverse_b, a_inverse_gradient = solved[:, :-1], solved[:, -1]
        schur = self._c.total().reshape(self._shared, self._shared) - b.T @ a_inverse_b
        covariance = np.linalg.inv(schur)
        shared = -covariance @ (self._shared_gradient.total() - b.T @ a_inverse_gradient)
        chained = -a_inverse_gradient - a_inverse_b @ shared
        return Solution(chained, shared, covariance, a, a_inverse_b)


@dataclass(frozen=True, slots=True)
class Solution:
    """One step and its covariance."""

    chained: Array
    """(chained,): x above."""
    shared: Array
    """(shared,): y above."""
    shared_covariance: Array
    """S⁻¹, (shared, shared)."""
    _a_factor: Array
    _a_inverse_b: Array

    def covariance_of_last(self, count: int) -> Array:
        """Of the last `count` unknowns of the chain, then all shared ones: (count + shared)².

        By the inverse of a block matrix: A⁻¹ + F S⁻¹ Fᵀ, and -F S⁻¹ beside it, F = A⁻¹ B.
        """
        units = np.zeros((len(self.chained), count))
        units[-count:] = np.eye(count)
        a_inverse = cho_solve_banded((self._a_factor, True), units)[-count:]
        coupling = self._a_inverse_b[-count:]
        beside = -coupling @ self.shared_covariance
        return np.block(
            [[a_inverse - beside @ coupling.T, beside], [beside.T, self.shared_covariance]]
        )
