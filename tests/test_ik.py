"""Damped least squares: the plain step, the weights against joint limits, and the step with bounds inside."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog, minimize, nnls

from naoimitate.ik import INFEASIBLE, SOLVED, bounded_step, damped_step, limit_avoiding_weights

FEASIBLE = 1e-8
"""Violation of a row that counts as rounding, rows of unit length."""


def weights(q: list[float], step: list[float], lower: list[float], upper: list[float]) -> np.ndarray:
    out = np.empty(len(q))
    limit_avoiding_weights(*(np.array(v, dtype=float) for v in (q, step, lower, upper)), out)
    return out


def test_weights_by_hand() -> None:
    """dH/dq = (u - l)^2 (2 q - u - l) / (4 (u - q)^2 (q - l)^2): for -1..1 at 0.5, 4 * 1 / (4 * 0.25 * 2.25)."""
    assert weights([0.5], [0.1], [-1.0], [1.0]) == pytest.approx([1.0 + 1.0 / 0.5625])
    assert weights([-0.5], [-0.1], [-1.0], [1.0]) == pytest.approx([1.0 + 1.0 / 0.5625])
    assert weights([1.0], [0.1], [0.0], [4.0]) == pytest.approx([1.0]), "away from the nearer limit"
    assert weights([1.0], [-0.1], [0.0], [4.0]) == pytest.approx([1.0 + 16.0 * 2.0 / (4.0 * 9.0 * 1.0)])


def test_weights_are_one_in_the_middle_at_rest_and_away_from_limits() -> None:
    assert weights([0.0, 0.5, 0.5], [0.3, 0.0, -0.3], [-1.0] * 3, [1.0] * 3) == pytest.approx([1.0, 1.0, 1.0])


def test_weights_stay_finite_at_and_beyond_a_limit() -> None:
    found = weights([1.0, 1.2, -1.0], [0.1, 0.1, -0.1], [-1.0] * 3, [1.0] * 3)
    assert np.isfinite(found).all() and (found > 1e3).all()


def test_weights_are_the_gradient_of_their_own_function() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        low, high = -rng.uniform(0.2, 2.0), rng.uniform(0.2, 2.0)
        q, d = rng.uniform(0.9 * low, 0.9 * high), 1e-6
        h = [(high - low) ** 2 / (4.0 * (high - x) * (x - low)) for x in (q + d, q - d)]
        gradient = (h[0] - h[1]) / (2.0 * d)
        assert weights([q], [np.sign(gradient)], [low], [high])[0] == pytest.approx(1.0 + abs(gradient), rel=1e-4)


def test_damped_step_is_the_formula() -> None:
    rng = np.random.default_rng(1)
    for _ in range(300):
        m, n = rng.integers(1, 7), rng.integers(1, 9)
        J, e = rng.normal(size=(m, n)), rng.normal(size=m)
        w, damping = rng.uniform(1.0, 50.0, n), 10.0 ** rng.uniform(-4.0, 0.0)
        inverse = np.diag(1.0 / w)
        expected = inverse @ J.T @ np.linalg.inv(J @ inverse @ J.T + damping**2 * np.eye(m)) @ e
        assert damped_step(J, e, w, damping) == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_damped_step_minimises_error_and_weighted_step() -> None:
    """min |J dq - e|^2 + damping^2 dq^T W dq has the same solution: (J^T J + damping^2 W)^-1 J^T e."""
    rng = np.random.default_rng(2)
    for _ in range(300):
        m, n = rng.integers(1, 7), rng.integers(1, 9)
        J, e, w = rng.normal(size=(m, n)), rng.normal(size=m), rng.uniform(1.0, 20.0, n)
        expected = np.linalg.solve(J.T @ J + 0.09 * np.diag(w), J.T @ e)
        assert damped_step(J, e, w, 0.3) == pytest.approx(expected, rel=1e-7, abs=1e-10)


def test_damped_step_stays_bounded_at_a_singularity() -> None:
    J = np.array([[0.2, 0.1], [0.0, 0.0]])
    for error in (np.array([0.0, 1.0]), np.array([1.0, 1.0])):
        assert np.linalg.norm(damped_step(J, error, np.ones(2), 0.3)) <= np.linalg.norm(error) / (2.0 * 0.3)


class Problem:
    """min 1/2 x^T H x - g^T x, C x >= b, the first rows equalities."""

    def __init__(self, H: np.ndarray, g: np.ndarray, C: np.ndarray, b: np.ndarray, equalities: int) -> None:
        self.H, self.g, self.C, self.b, self.equalities = H, g, C, b, equalities

    def solve(self) -> tuple[int, np.ndarray]:
        x = np.full(len(self.g), np.nan)
        return bounded_step(self.H, self.g, self.C, self.b, self.equalities, x), x

    def feasible(self) -> bool:
        """By linear programming (HiGHS)."""
        e = self.equalities
        answer = linprog(
            np.zeros(len(self.g)),
            A_ub=-self.C[e:] if e < len(self.b) else None,
            b_ub=-self.b[e:] if e < len(self.b) else None,
            A_eq=self.C[:e] if e else None,
            b_eq=self.b[:e] if e else None,
            bounds=(None, None),
        )
        return bool(answer.status == 0)

    def violation(self, x: np.ndarray) -> float:
        rows = self.C @ x - self.b
        return float(max(np.abs(rows[: self.equalities]).max(initial=0.0), -rows[self.equalities :].min(initial=0.0)))

    def optimality(self, x: np.ndarray) -> float:
        """Distance of the gradient to the cone of active rows: 0 exactly at the minimum (Karush, Kuhn, Tucker)."""
        rows = self.C @ x - self.b
        equal = np.arange(len(rows)) < self.equalities
        active = self.C[(np.abs(rows) < 1e-7) & ~equal]
        cone = np.vstack([active, self.C[equal], -self.C[equal]])
        gradient = self.H @ x - self.g
        distance = nnls(cone.T, gradient)[1] if len(cone) else np.linalg.norm(gradient)
        return float(distance / (1.0 + np.linalg.norm(self.g)))


def random_problem(rng: np.random.Generator, kind: str) -> Problem:
    n = int(rng.integers(1, 13))
    k, equalities = int(rng.integers(0, 3 * n + 2)), int(rng.integers(0, n // 2 + 1))
    J = rng.normal(size=(int(rng.integers(1, n + 2)), n))
    H = J.T @ J * 10.0 ** rng.uniform(-1.0, 3.0) + 10.0 ** rng.uniform(-6.0, 0.0) * np.eye(n)
    C = rng.normal(size=(k + equalities, n))
    C /= np.linalg.norm(C, axis=1, keepdims=True)
    inside = rng.normal(size=n)
    slack = rng.exponential(0.3, size=len(C)) * (rng.random(len(C)) < 0.7)
    slack[:equalities] = 0.0
    b = C @ inside - slack
    if kind == "box":
        C = np.vstack([C[:equalities], np.eye(n), -np.eye(n)])
        width = rng.exponential(0.3, size=(2, n))
        b = np.concatenate([b[:equalities], inside - width[0], -inside - width[1]])
    if kind == "doubled":
        rows = rng.integers(equalities, len(C), size=4) if len(C) > equalities else np.zeros(0, dtype=int)
        C, b = np.vstack([C, C[rows], np.zeros((1, n))]), np.concatenate([b, b[rows], [-0.1]])
    if kind == "opposed" and len(C) > equalities:
        b[-1] = C[-1] @ inside
        C, b = np.vstack([C, -C[-1:]]), np.concatenate([b, -b[-1:]])
    if kind == "loose":
        b[equalities:] += rng.exponential(0.5, size=len(b) - equalities)
    return Problem(H, rng.normal(size=n) * 3.0, C, b, equalities)


@pytest.mark.parametrize("kind", ["plain", "box", "doubled", "opposed"])
def test_bounded_step_is_the_minimum_on_random_problems(kind: str) -> None:
    """1000 problems of each kind, all feasible by construction; optimality proved by the KKT conditions."""
    rng = np.random.default_rng(3)
    for _ in range(1000):
        problem = random_problem(rng, kind)
        status, x = problem.solve()
        assert status == SOLVED
        assert problem.violation(x) < FEASIBLE
        assert problem.optimality(x) < 1e-6


def test_bounded_step_tells_infeasible_problems_from_feasible_ones() -> None:
    """Random bounds that may contradict each other; HiGHS decides which do."""
    rng = np.random.default_rng(4)
    seen = {SOLVED: 0, INFEASIBLE: 0}
    for _ in range(400):
        problem = random_problem(rng, "loose")
        status, x = problem.solve()
        seen[status] += 1
        assert (status == SOLVED) == problem.feasible()
        if status == SOLVED:
            assert problem.violation(x) < FEASIBLE and problem.optimality(x) < 1e-6
    assert min(seen.values()) > 50


def test_bounded_step_agrees_with_slsqp() -> None:
    rng = np.random.default_rng(5)
    for _ in range(40):
        problem = random_problem(rng, "box")
        problem.H += np.eye(len(problem.g))
        status, x = problem.solve()
        e = problem.equalities
        constraints = [{"type": "ineq", "fun": lambda y, p=problem, e=e: p.C[e:] @ y - p.b[e:]}]
        if e:
            constraints.append({"type": "eq", "fun": lambda y, p=problem, e=e: p.C[:e] @ y - p.b[:e]})
        other = minimize(
            lambda y, p=problem: 0.5 * y @ p.H @ y - p.g @ y,
            np.zeros(len(x)),
            jac=lambda y, p=problem: p.H @ y - p.g,
            constraints=constraints,
            method="SLSQP",
            options={"maxiter": 300, "ftol": 1e-13},
        )
        assert status == SOLVED
        cost = 0.5 * x @ problem.H @ x - problem.g @ x
        assert cost <= other.fun + 1e-6 * (1.0 + abs(other.fun))


def test_bounded_step_without_rows_is_the_plain_minimum() -> None:
    H, g = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([1.0, -1.0])
    status, x = Problem(H, g, np.zeros((0, 2)), np.zeros(0), 0).solve()
    assert status == SOLVED
    assert x == pytest.approx(np.linalg.solve(H, g))


def test_bounded_step_takes_an_equality_given_twice() -> None:
    row = np.array([[1.0, 1.0, 0.0]])
    status, x = Problem(np.eye(3), np.zeros(3), np.vstack([row, row, -row]), np.array([1.0, 1.0, -1.0]), 3).solve()
    assert status == SOLVED
    assert x == pytest.approx([0.5, 0.5, 0.0])


@pytest.mark.parametrize(
    ("C", "b", "equalities"),
    [
        ([[1.0, 0.0], [-1.0, 0.0]], [1.0, 0.0], 0),
        ([[0.0, 0.0]], [1.0], 0),
        ([[1.0, 1.0], [2.0, 2.0]], [1.0, 3.0], 2),
        ([[1.0, 0.0], [1.0, 0.0]], [0.0, 1e-3], 1),
        ([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]], [1.0, 1.0, -1.9], 0),
    ],
)
def test_bounded_step_reports_contradictions(C: list[list[float]], b: list[float], equalities: int) -> None:
    status, _ = Problem(np.eye(2), np.ones(2), np.array(C), np.array(b), equalities).solve()
    assert status == INFEASIBLE
