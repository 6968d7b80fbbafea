"""Nobody passes of whom nothing is known."""

import pytest

from scenarios.bench.metric import Metric, Part, all_pass

NAN = float("nan")


def figure(name: str, passed: bool | None, value: float = 1.0, part: bool | None = None) -> Metric:
    parts = () if part is None else (Part("p3", 2.0, 1.0, (NAN, NAN), (0.0, 1.5), part, theory=False),)
    return Metric(name, name, "", value, 1.0, (NAN, NAN), passed, 0.0, "", parts)


@pytest.mark.parametrize(
    ("figures", "passes"),
    [
        ((figure("bias", True), figure("coverage", None)), True),
        ((figure("bias", True), figure("coverage", False)), False),
        ((figure("bias", None), figure("coverage", None), figure("reliability", True), figure("speed", True)), False),
        ((figure("bias", None), figure("reliability", None)), False),
        ((figure("efficiency", None, part=False),), True),
        ((figure("speed", True),), True),
        ((figure("bandwidth", None),), True),
        ((figure("bandwidth", None, NAN), figure("reliability", None, NAN)), False),
        ((), False),
    ],
)
def test_whether_all_pass(figures: tuple[Metric, ...], passes: bool) -> None:
    assert all_pass({one.name: one for one in figures}) is passes
