"""Newton's method for the balances of an arm at rest."""

from collections.abc import Callable

import numpy as np


def newton(function: Callable[[np.ndarray], np.ndarray], start: np.ndarray) -> np.ndarray:
    """Solve by Newton's method with centred differences, halving steps that make matters worse.

    Args:
        function: What is to vanish, (n,) of (n,), all of order one or smaller.
        start: Where to begin (n,).

    Returns:
        The point (n,) reached; whether the function vanishes there is the caller's to check.
    """
    point, value = start, function(start)
    for _ in range(50):
        if np.abs(value).max() < 1e-12:
            break
        columns = [(function(point + e) - function(point - e)) / 2e-6 for e in 1e-6 * np.eye(len(point))]
        step = np.linalg.solve(np.column_stack(columns), -value)
        for _ in range(20):
            trial = function(point + step)
            if np.linalg.norm(trial) < np.linalg.norm(value):
                break
            step = 0.5 * step
        else:
            break
        point, value = point + step, trial
    return point
