"""Records that cost no simulation, and the report of the study, drawn once."""

from dataclasses import dataclass

import matplotlib
import numpy as np
import pytest
from scipy.signal import lfilter

from hmtb_twin import JOINTS, JointLog
from scenarios.report.figures import SETTINGS, Gallery
from scenarios.thesis.findings import findings
from scenarios.thesis.report import context


def joint_log(name: str, commanded: np.ndarray, measured: np.ndarray, true_angles: np.ndarray) -> JointLog:
    """Make a log of angles (N, 7), rad; all else is zero."""
    samples = len(commanded)
    silent = np.zeros((samples, 1))
    return JointLog(
        name=name,
        seed=0,
        dt=0.02,
        axes=("shoulder_yaw",),
        commanded=commanded,
        measured=measured,
        wrench=np.zeros((samples, 6)),
        true_angles=true_angles,
        load_pressure=np.zeros_like(commanded),
        volts=silent,
        counts=silent,
        status=np.zeros(samples, dtype=np.int64),
    )


@pytest.fixture(scope="session")
def synthetic_logs():
    """Makes logs of 20 s by name: every joint of second order, its command white, its measurement a little noisy."""

    def made(names):
        logs = {}
        for seed, name in enumerate(names):
            u, noise = np.random.default_rng(seed).standard_normal((2, 1000, len(JOINTS)))
            y = lfilter([0.0, 0.06, 0.04], [1.0, -1.4, 0.5], 0.1 * u, axis=0) + 1e-4 * noise
            logs[name] = joint_log(name, 0.1 * u, y, y)
        return logs

    return made


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
