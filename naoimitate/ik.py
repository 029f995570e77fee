"""Damped least squares: the plain step, the weights that avoid joint limits, and the step with bounds inside.

All functions are compiled and work on small flat arrays; n is the number of joints of a chain, m of task rows.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[np.float64]

SOLVED = 0
INFEASIBLE = 1
_TINY = 1e-12
_NEGLIGIBLE = 1e-8
"""Violation of a row that depends on the active ones which counts as rounding."""
_MAX_CHANGES = 200


@njit(cache=True)
def limit_avoiding_weights(q: Array, step: Array, lower: Array, upper: Array, out: Array) -> None:
    """Weighted least norm of Chang and Dubey 1995, equations 15 to 17: w = 1 + |dH/dq| towards a limit, 1 away from it.

    H(q) = sum (u - l)^2 / (4 (u - q)(q - l)). q, step (the previous one), lower, upper: (n,) rad; out: (n,).
    """
    for i in range(q.shape[0]):
        span = upper[i] - lower[i]
        over = max(upper[i] - q[i], 1e-4 * span)
        under = max(q[i] - lower[i], 1e-4 * span)
        gradient = span * span * (under - over) / (4.0 * over * over * under * under)
        out[i] = 1.0 + abs(gradient) if gradient * step[i] > 0.0 else 1.0


@njit(cache=True)
def damped_step(J: Array, error: Array, weights: Array, damping: float) -> Array:
    """dq = W^-1 J^T (J W^-1 J^T + damping^2 E)^-1 e: damped least squares with a diagonal weighting.

    J: (m, n), error: (m,), weights: (n,) > 0, damping: in the unit of J. Returns (n,) rad.
    """
    m = J.shape[0]
    JW = J / weights
    A = JW @ J.T
    for i in range(m):
        A[i, i] += damping * damping
    return JW.T @ np.linalg.solve(A, error)


@njit(cache=True)
def bounded_step(H: Array, g: Array, C: Array, b: Array, equalities: int, x: Array) -> int:
    """min 1/2 x^T H x - g^T x subject to C x >= b, the first rows being equalities: least squares with bounds inside.

    With H = J^T W J + damping^2 E and g = J^T W e this is the damped least squares step that keeps joint, speed and
    distance bounds exactly, instead of cutting a step afterwards, which would move planted feet apart.

    H: (n, n) positive definite; C: (k, n); b: (k,); x: (n,), written.
    Returns ``SOLVED`` or ``INFEASIBLE`` (x is then the last iterate and must not be used).
    """
    return priced_step(H, g, C, b, equalities, x, np.empty(C.shape[0]))


@njit(cache=True)
def priced_step(H: Array, g: Array, C: Array, b: Array, equalities: int, x: Array, price: Array) -> int:
    """``bounded_step`` that also tells what each row costs: price (k,), written, the rows' Lagrange multipliers.

    Dual active-set method of Goldfarb and Idnani 1983: starts from the unconstrained minimum, adds the most violated
    row, drops rows whose multiplier turns negative.
    """
    n, k = H.shape[0], C.shape[0]
    price[:] = 0.0
    L = np.linalg.cholesky(H)
    J = np.ascontiguousarray(np.linalg.inv(L).T)
    x[:] = J @ (J.T @ g)
    R = np.zeros((n, n))
    active = np.empty(n, np.int64)
    sign = np.ones(k)
    u = np.zeros(n)
    is_active, is_redundant = np.zeros(k, np.bool_), np.zeros(k, np.bool_)
    size = 0
    for _ in range(_MAX_CHANGES):
        p = _most_violated(C, b, equalities, x, is_active | is_redundant)
        if p < 0:
            for i in range(size):
                price[active[i]] = u[i]
            return SOLVED
        s = _row_value(C, p, x) - b[p]
        sign[p] = -1.0 if p < equalities and s > 0.0 else 1.0
        s *= sign[p]
        u_p = 0.0
        while True:
            d = J.T @ (sign[p] * C[p])
            z = _free_direction(J, d, size)
            r = _back_substitute(R, d, size)
            drop, t1 = _blocking(active, u, r, size, equalities)
            slope = 0.0
            for i in range(size, n):
                slope += d[i] * d[i]
            t2 = -s / slope if slope > _TINY else math.inf
            if t2 == math.inf and u_p == 0.0 and s > -_NEGLIGIBLE:
                is_redundant[p] = True
                break
            t = min(t1, t2)
            if t == math.inf:
                return INFEASIBLE
            for i in range(size):
                u[i] -= t * r[i]
            u_p += t
            if t2 < math.inf:
                x += t * z
                s += t * slope
            if t2 <= t1:
                _add_row(R, J, d, size)
                active[size] = p
                u[size] = u_p
                is_active[p] = True
                size += 1
                break
            is_active[active[drop]] = False
            is_redundant[:] = False
            size = _drop_row(R, J, active, u, drop, size)
    return INFEASIBLE


@njit(cache=True)
def _row_value(C: Array, i: int, x: Array) -> float:
    value = 0.0
    for j in range(x.shape[0]):
        value += C[i, j] * x[j]
    return value


@njit(cache=True)
def _most_violated(C: Array, b: Array, equalities: int, x: Array, done: Array) -> int:
    worst, row = -1e-10, -1
    for i in range(C.shape[0]):
        if done[i]:
            continue
        s = _row_value(C, i, x) - b[i]
        if i < equalities:
            return i
        if s < worst:
            worst, row = s, i
    return row


@njit(cache=True)
def _free_direction(J: Array, d: Array, size: int) -> Array:
    n = J.shape[0]
    z = np.zeros(n)
    for i in range(n):
        for j in range(size, n):
            z[i] += J[i, j] * d[j]
    return z


@njit(cache=True)
def _back_substitute(R: Array, d: Array, size: int) -> Array:
    r = np.empty(size)
    for i in range(size - 1, -1, -1):
        value = d[i]
        for j in range(i + 1, size):
            value -= R[i, j] * r[j]
        r[i] = value / R[i, i]
    return r


@njit(cache=True)
def _blocking(active: Array, u: Array, r: Array, size: int, equalities: int) -> tuple[int, float]:
    """The active inequality whose multiplier reaches zero first, and the step at which it does."""
    drop, t1 = -1, math.inf
    for i in range(size):
        if active[i] >= equalities and r[i] > _TINY and u[i] / r[i] < t1:
            drop, t1 = i, u[i] / r[i]
    return drop, t1


@njit(cache=True)
def _rotate(a: float, b: float) -> tuple[float, float, float]:
    length = math.hypot(a, b)
    return (1.0, 0.0, 0.0) if length == 0.0 else (a / length, b / length, length)


@njit(cache=True)
def _add_row(R: Array, J: Array, d: Array, size: int) -> None:
    """Givens rotations turn d below ``size`` to zero; its head becomes the new column of R."""
    n = d.shape[0]
    for i in range(n - 1, size, -1):
        c, s, length = _rotate(d[i - 1], d[i])
        d[i - 1], d[i] = length, 0.0
        for k in range(n):
            a, b = J[k, i - 1], J[k, i]
            J[k, i - 1], J[k, i] = c * a + s * b, c * b - s * a
    for i in range(size + 1):
        R[i, size] = d[i]


@njit(cache=True)
def _drop_row(R: Array, J: Array, active: Array, u: Array, drop: int, size: int) -> int:
    """Remove a column of R and restore its triangle with Givens rotations."""
    n = J.shape[0]
    for j in range(drop, size - 1):
        active[j], u[j] = active[j + 1], u[j + 1]
        for i in range(size):
            R[i, j] = R[i, j + 1]
    size -= 1
    for j in range(drop, size):
        c, s, length = _rotate(R[j, j], R[j + 1, j])
        R[j, j], R[j + 1, j] = length, 0.0
        for k in range(j + 1, size):
            a, b = R[j, k], R[j + 1, k]
            R[j, k], R[j + 1, k] = c * a + s * b, c * b - s * a
        for k in range(n):
            a, b = J[k, j], J[k, j + 1]
            J[k, j], J[k, j + 1] = c * a + s * b, c * b - s * a
    return size
