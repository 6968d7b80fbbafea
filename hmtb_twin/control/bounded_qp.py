"""Active-set solver of small convex quadratic programmes with bounds: the step of resolved-rate control."""

import numpy as np

ITERATIONS = 50
"""More changes of the active set than any step of three unknowns needs; a bound against cycling."""

NEGLIGIBLE = 1e-12
"""Relative motion of a bounded quantity below which a direction does not move it."""


def bounded_step(
    hessian: np.ndarray, gradient: np.ndarray, rows: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, list[int]]:
    """Minimise `step @ hessian @ step / 2 - gradient @ step` subject to `lower <= rows @ step <= upper`.

    The primal active-set method [NocedalWright2006, algorithm 16.3], started at the zero step.

    Args:
        hessian: Positive definite (n, n).
        gradient: (n,).
        rows: Bounded linear functions of the step (m, n).
        lower: Lower bounds (m,), none above zero.
        upper: Upper bounds (m,), none below zero.

    Returns:
        The step (n,) and the active rows.
    """
    n = len(gradient)
    step = np.zeros(n)
    # Row and the side on which it is held: +1 at its upper bound, -1 at its lower.
    active: dict[int, float] = {}
    for _ in range(ITERATIONS):
        direction, multipliers = _constrained_direction(hessian, gradient - hessian @ step, rows[list(active)])
        speed = rows @ direction
        fraction, blocking = 1.0, -1
        for row in range(len(rows)):
            # A row that does not move cannot block; added to the active ones it would make their matrix singular.
            if row in active or abs(speed[row]) <= NEGLIGIBLE * (1.0 + np.abs(rows[row]).sum()):
                continue
            rising = speed[row] > 0.0
            bound = upper[row] if rising else lower[row]
            room = bound - rows[row] @ step
            blocks = room < fraction * speed[row] if rising else room > fraction * speed[row]
            if blocks:
                # By rounding a row may stand beyond its bound already: never go backward.
                fraction, blocking = max(room / speed[row], 0.0), row
        step = step + fraction * direction
        if blocking >= 0:
            active[blocking] = np.sign(speed[blocking])
            continue
        # A bound with a negative multiplier pulls: the objective falls when the step leaves it.
        pushes = {}
        for (row, side), multiplier in zip(active.items(), multipliers, strict=True):
            pushes[row] = multiplier * side
        if not pushes or min(pushes.values()) >= 0.0:
            break
        del active[min(pushes, key=pushes.__getitem__)]
    return step, list(active)


def _constrained_direction(
    hessian: np.ndarray, gradient: np.ndarray, held: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the direction to the minimum along which the held rows keep their values, and their multipliers."""
    # The conditions of Karush, Kuhn and Tucker for equality constraints, one linear system.
    n = len(gradient)
    matrix = np.zeros((n + len(held), n + len(held)))
    matrix[:n, :n], matrix[:n, n:], matrix[n:, :n] = hessian, held.T, held
    solution = np.linalg.solve(matrix, np.concatenate([gradient, np.zeros(len(held))]))
    return solution[:n], solution[n:]
