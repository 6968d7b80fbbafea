"""A record of a first-order system, and the labels of a legend."""

import numpy as np

from sysid import IOData, StateSpace, simulate

MODEL = StateSpace([[0.9]], [[0.1]], [[1.0]], [[0.0]], None, 0.02, [[1e-4]])


def drawn(seed, samples=600):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(samples)
    y = simulate(MODEL, u, rng=rng)
    return IOData(u, y, 0.02, input_units=("V",), output_units=("rad",), name=f"run {seed}")


DATA = drawn(0)


def labels(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]
