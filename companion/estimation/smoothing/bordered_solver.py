"""Solves least squares over a chain of poses and a few unknowns shared by all residuals.

A residual depends on one pose or two adjacent poses, and on some of the shared unknowns. So the
normal equations are a narrow band with a border,

    [ A   B ] [ x ]     [ a ]        A: band, poses        x: step of the poses
    [ Bᵀ  C ] [ y ] = - [ b ]        C: small and full     y: step of the shared unknowns

With the Cholesky factor A = L Lᵀ and W = L⁻¹ B, w = L⁻¹ a, the Schur complement S = C - Wᵀ W gives
y = -S⁻¹ (b - Wᵀ w), and y gives x = -L⁻ᵀ (w + W y). S⁻¹ is the covariance of the shared unknowns
with the poses integrated out. Time and memory are linear in the length of the chain.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise, starmap

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.linalg.lapack import dtbtrs

from companion.core.arrays import Array, Indices

Gradient = Sequence[tuple[Indices | int, Array]]
"""Gradient of n residuals: columns, (n,) or one for all, and the derivatives by those unknowns,
(n,)."""
AT_ONCE = 4096
"""Residuals added at once, which bounds the memory. Chosen."""


CAUCHY_SIGMAS = 2.0
"""Scale of the Cauchy loss, in sigmas. Chosen."""


def cauchy(residual: Array) -> Array:
    """Factor on the sigma of each residual (in sigmas) by the Cauchy loss."""
    growth: Array = np.sqrt(1 + (residual / CAUCHY_SIGMAS) ** 2)
    return growth


class Sums:
    """Sums values by index, many at a time."""

    BATCH = 200_000
    """Values are summed after this many, which bounds the memory. Chosen."""
    SPARSE = 10
    """Sums for each value from which values are added one by one. Chosen: an array of all sums is
    slower then, and as large as the border of all flights."""

    def __init__(self, size: int) -> None:
        self._total = np.zeros(size)
        self._places: list[Indices] = []
        self._values: list[Array] = []
        self._pending = 0

    def add(self, places: Indices, values: Array) -> None:
        """Add values to the sums at places of the same shape."""
        self._places.append(places.ravel())
        self._values.append(values.ravel())
        self._pending += values.size
        if self._pending > self.BATCH:
            self._add_up()

    def total(self) -> Array:
        """The sums, (size,)."""
        if self._places:
            self._add_up()
        return self._total

    def _add_up(self) -> None:
        places, values = np.concatenate(self._places), np.concatenate(self._values)
        if len(self._total) > self.SPARSE * len(values):
            np.add.at(self._total, places, values)
        else:
            self._total += np.bincount(places, values, len(self._total))
        self._places, self._values, self._pending = [], [], 0


@dataclass(frozen=True, slots=True)
class Gaussian:
    """A Gaussian of one pose and the shared unknowns: ½ δᵀ·information·δ + gradientᵀ·δ."""

    information: Array
    """(pose + shared, pose + shared)."""
    gradient: Array
    """(pose + shared,)."""

    def moved(self, delta: Array) -> "Gaussian":
        """The same Gaussian about a point that is `delta` further."""
        return Gaussian(self.information, self.gradient + self.information @ delta)

    def cost(self, delta: Array) -> float:
        """χ² of a point at `delta` from the reference point."""
        return float(delta @ self.information @ delta + 2 * self.gradient @ delta)

    def grown(self, size: int) -> "Gaussian":
        """Append unknowns without information, to `size` in total."""
        more = size - len(self.gradient)
        return Gaussian(
            np.pad(self.information, ((0, more), (0, more))), np.pad(self.gradient, (0, more))
        )


def _stacked(gradient: Gradient, residuals: int) -> tuple[Indices, Array]:
    """Columns and derivatives of a gradient, (unknowns, residuals) each."""
    shape = len(gradient), residuals
    columns, derivatives = np.empty(shape, dtype=np.int64), np.empty(shape)
    for unknown, (column, by_unknown) in enumerate(gradient):
        columns[unknown], derivatives[unknown] = column, by_unknown
    return columns, derivatives


@cache
def _lower_triangle(size: int) -> tuple[Indices, Indices]:
    """Rows and columns of the lower triangle, which is needed for each addition."""
    return np.tril_indices(size)


class BorderedSystem:
    """Collects the normal equations, row by row of the Jacobian."""

    def __init__(
        self, chained: int, shared: int, bandwidth: int, begins: Sequence[int] = (0,)
    ) -> None:
        """`bandwidth`: largest distance of coupled unknowns in the chain.

        `begins`: first unknowns of parts of the chain that nothing couples with those before.
        """
        self._chained, self._shared, self._band = chained, shared, bandwidth
        self._begins = tuple(begins)
        self._a = Sums(bandwidth * chained)
        self._b = Sums(chained * shared)
        self._c = Sums(shared * shared)
        self._chain_gradient = Sums(chained)
        self._shared_gradient = Sums(shared)
        self.squares, self.rows = 0.0, 0
        """Sum of squares of all residuals in their sigmas, and number of residuals."""

    def add(
        self, residual: Array, sigma: Array | float, chained: Gradient, shared: Gradient = ()
    ) -> None:
        """Add residuals (n,), their sigmas and their gradients."""
        weight = np.broadcast_to(1 / np.square(sigma), residual.shape)
        self.squares += float((weight * residual**2).sum())
        self.rows += len(residual)
        rows, by_rows = _stacked(chained, len(residual))
        columns, by_columns = _stacked(shared, len(residual))
        for first in range(0, len(residual), AT_ONCE):
            part = np.s_[..., first : first + AT_ONCE]
            self._add_some(
                residual[part],
                weight[part],
                (rows[part], by_rows[part]),
                (columns[part], by_columns[part]),
            )

    def _add_some(
        self,
        residual: Array,
        weight: Array,
        chained: tuple[Indices, Array],
        shared: tuple[Indices, Array],
    ) -> None:
        """Add residuals (n,); of both kinds of unknowns columns and derivatives, (unknowns, n)."""
        (rows, by_rows), (columns, by_columns) = chained, shared
        weighted, weighted_shared = weight * by_rows, weight * by_columns
        self._chain_gradient.add(rows, weighted * residual)
        self._shared_gradient.add(columns, weighted_shared * residual)
        i, j = _lower_triangle(len(rows))
        low, high = np.minimum(rows[i], rows[j]), np.maximum(rows[i], rows[j])
        self._a.add((high - low) * self._chained + low, weighted[i] * by_rows[j])
        self._b.add(rows[:, None] * self._shared + columns, weighted[:, None] * by_columns)
        places = columns[:, None] * self._shared + columns
        self._c.add(places, weighted_shared[:, None] * by_columns)

    def add_prior(self, prior: Gaussian) -> None:
        """Add a prior on the first unknowns of the chain and all shared ones."""
        count = len(prior.gradient) - self._shared
        first, shared = np.arange(count), np.arange(self._shared)
        row, column = np.tril_indices(count)
        self._a.add((row - column) * self._chained + column, prior.information[row, column])
        self._b.add(
            (first[:, None] * self._shared + shared).ravel(),
            prior.information[:count, count:].ravel(),
        )
        self._c.add(np.arange(self._shared**2), prior.information[count:, count:].ravel())
        self._chain_gradient.add(first, prior.gradient[:count])
        self._shared_gradient.add(shared, prior.gradient[count:])

    def solve(self) -> "Solution":
        """The Gauss-Newton step with its covariance."""
        schur, gradient, blocks = self._eliminated()
        covariance = np.asarray(np.linalg.inv(schur), dtype=np.float64)
        shared = -covariance @ gradient
        chained = np.concatenate([block.step(shared) for block in blocks])
        return Solution(chained, shared, covariance, blocks[-1])

    def of_shared(self) -> tuple[Array, Array]:
        """S (s, s) and the gradient (s,) of the shared unknowns, with the poses integrated out."""
        schur, gradient, _ = self._eliminated()
        return schur, gradient

    def _eliminated(self) -> tuple[Array, Array, list["_Block"]]:
        """S, the gradient of the shared unknowns, and the blocks of the chain.

        No motion couples two flights, and a flight has residuals with some of the shared unknowns
        only. So each flight is solved alone, with the columns of B that are not zero.
        """
        a, b, c, a_gradient, b_gradient = self._totals()
        schur, gradient = c.copy(), b_gradient.copy()
        blocks = []
        for rows in starmap(slice, pairwise((*self._begins, self._chained))):
            columns = np.flatnonzero(b[rows].any(axis=0))
            factor = cholesky_banded(a[:, rows], lower=True)
            right = np.empty((len(a_gradient[rows]), len(columns) + 1), order="F")
            for number, column in enumerate(columns):  # in place: B is the largest matrix
                right[:, number] = b[rows, column]
            right[:, -1] = a_gradient[rows]
            solved = _forward(factor, right)
            block = _Block(factor, columns, solved[:, :-1], solved[:, -1])
            schur[np.ix_(columns, columns)] -= block.w_matrix.T @ block.w_matrix
            gradient[columns] -= block.w_matrix.T @ block.w_vector
            blocks.append(block)
        return schur, gradient, blocks

    def marginal_of_last(self, count: int) -> Gaussian:
        """Gaussian of the chain's last unknowns and all shared ones, the others integrated out."""
        a, b, c, a_gradient, b_gradient = self._totals()
        before = self._chained - count
        factor = cholesky_banded(a[:, :before], lower=True)
        coupling = np.zeros((before, count + self._shared))
        corner = np.zeros((count + self._shared,) * 2)
        for column in range(before - min(self._band, before), before):
            for row in range(before, min(column + self._band, self._chained)):
                coupling[column, row - before] = a[row - column, column]
        for column in range(before, self._chained):
            for row in range(column, min(column + self._band, self._chained)):
                i, j = row - before, column - before
                corner[i, j] = corner[j, i] = a[row - column, column]
        coupling[:, count:] = b[:before]
        corner[:count, count:], corner[count:, :count] = b[before:], b[before:].T
        corner[count:, count:] = c
        gradient = np.concatenate([a_gradient[before:], b_gradient])
        solved = _forward(factor, np.column_stack([coupling, a_gradient[:before]]))
        w_matrix, w_vector = solved[:, :-1], solved[:, -1]
        return Gaussian(corner - w_matrix.T @ w_matrix, gradient - w_matrix.T @ w_vector)

    def _totals(self) -> tuple[Array, Array, Array, Array, Array]:
        """A (band, chained), B (chained, shared), C (shared, shared), a and b."""
        return (
            self._a.total().reshape(self._band, self._chained),
            self._b.total().reshape(self._chained, self._shared),
            self._c.total().reshape(self._shared, self._shared),
            self._chain_gradient.total(),
            self._shared_gradient.total(),
        )


@dataclass(frozen=True, slots=True)
class _Block:
    """A part of the chain that nothing couples with the others, solved."""

    factor: Array
    """L of its part of A, (band, rows): row d is the diagonal d below the main one."""
    columns: Indices
    """(c,): shared unknowns with which it has residuals."""
    w_matrix: Array
    """W, (rows, c)."""
    w_vector: Array
    """w, (rows,)."""

    def step(self, shared: Array) -> Array:
        """(rows,): step of its unknowns."""
        right = self.w_vector + self.w_matrix @ shared[self.columns]
        return -_backward(self.factor, right[:, None])[:, 0]


def _forward(factor: Array, right: Array) -> Array:
    """L⁻¹ of columns (rows, n), which are overwritten if they are stored column by column."""
    solved: Array = dtbtrs(factor, right, uplo="L", overwrite_b=True)[0]
    return solved


def _backward(factor: Array, right: Array) -> Array:
    """L⁻ᵀ of columns (rows, n)."""
    solved: Array = dtbtrs(factor, right, uplo="L", trans="T")[0]
    return solved


@dataclass(frozen=True, slots=True)
class Solution:
    """One step and its covariance."""

    chained: Array
    """(chained,): x in the module's docstring."""
    shared: Array
    """(shared,): y in the module's docstring."""
    shared_covariance: Array
    """S⁻¹, (shared, shared)."""
    _last: _Block

    def covariance_of_last(self, count: int) -> Array:
        """Covariance of the last `count` unknowns of the chain and all shared ones.

        Shape (count + shared, count + shared). By the inverse of a block matrix: A⁻¹ + F S⁻¹ Fᵀ,
        and -F S⁻¹ beside it, F = A⁻¹ B. With V = L⁻¹ of the last unit vectors, the last rows of A⁻¹
        are Vᵀ V, and those of F are Vᵀ W.
        """
        units = np.zeros((len(self._last.w_vector), count))
        units[-count:] = np.eye(count)
        v = _forward(self._last.factor, units)[-count:]
        coupling = np.zeros((count, len(self.shared)))
        coupling[:, self._last.columns] = v.T @ self._last.w_matrix[-count:]
        beside = -coupling @ self.shared_covariance
        return np.block(
            [[v.T @ v - beside @ coupling.T, beside], [beside.T, self.shared_covariance]]
        )

    def samples_of_last(self, unit: Array) -> Array:
        """Samples of the last part of the chain from the posterior, about the solution.

        `unit` (rows + shared, n): independent samples of unit variance. The result is (rows, n).
        With y = S^-½ v and x = L⁻ᵀ (u - W y) the covariance is the inverse of the equations. The
        root is that of the eigenvalues: rounding may leave the smallest ones below zero.
        """
        rows = len(self._last.w_vector)
        variances, directions = np.linalg.eigh(self.shared_covariance)
        shared = directions * np.sqrt(np.maximum(variances, 0.0)) @ unit[rows:]
        right = unit[:rows] - self._last.w_matrix @ shared[self._last.columns]
        return _backward(self._last.factor, right)
