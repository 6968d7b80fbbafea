"""Records that cost no simulation, and the report of the study, made once."""

import numpy as np
import pytest
from scipy.signal import lfilter

from hmtb_twin import JOINTS, JointLog
from scenarios.thesis.answer import measure_answer
from scenarios.thesis.findings import findings
from scenarios.thesis.report_contents import report_contents


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


@pytest.fixture(scope="session")
def answer(study):
    """Responses of the first screen, from fewer records than a study has."""
    return measure_answer(study, seeds=(1, 2))


@pytest.fixture(scope="session")
def report(study, answer):
    """Contents of the report: computed once."""
    with pytest.MonkeyPatch.context() as patch:
        # Two frames show as much as fifty.
        patch.setattr("scenarios.thesis.pictures.SPAN", (20.0, 20.1))
        return report_contents(study, findings(study), answer)
