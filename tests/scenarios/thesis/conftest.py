"""Records that cost no simulation, and the report of the study, drawn once."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
import pytest
from scipy.signal import lfilter

from hmtb_twin import JOINTS, JointLog
from scenarios.report.figures import SETTINGS, Gallery
from scenarios.thesis.findings import findings
from scenarios.thesis.report import context

Made = Callable[[Sequence[str]], dict[str, JointLog]]


@pytest.fixture(scope="session")
def synthetic_logs():
    """Makes logs of 20 s by name: every joint of second order, its command white, its measurement a little noisy."""

    def made(names: Sequence[str]) -> dict[str, JointLog]:
        return {name: _log(name, seed) for seed, name in enumerate(names)}

    return made


def _log(name: str, seed: int) -> JointLog:
    rng = np.random.default_rng(seed)
    samples, joints = 1000, len(JOINTS)
    u = 0.1 * rng.standard_normal((samples, joints))
    y = np.asarray(lfilter([0.0, 0.06, 0.04], [1.0, -1.4, 0.5], u, axis=0)) + 1e-4 * rng.standard_normal(u.shape)
    silent = np.zeros((samples, 1))
    return JointLog(
        name=name,
        seed=seed,
        dt=0.02,
        axes=("shoulder_yaw",),
        commanded=u,
        measured=y,
        wrench=np.zeros((samples, 6)),
        true_angles=y,
        load_pressure=np.zeros((samples, joints)),
        volts=silent,
        counts=silent,
        status=np.zeros(samples, dtype=np.int64),
    )


@dataclass(frozen=True)
class Report:
    """Variables of the report's templates, and its figures."""

    context: dict[str, object]
    gallery: Gallery


@pytest.fixture(scope="session")
def report(study):
    """The report of the study: drawn once, because a hundred figures take half a minute."""
    gallery = Gallery()
    with matplotlib.rc_context(SETTINGS):
        return Report(context(study, findings(study), gallery, None), gallery)
