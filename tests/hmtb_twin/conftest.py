from dataclasses import dataclass, field

import numpy as np
import pytest

from hmtb_twin import Chain, HandController, PayloadChange, Plant, Specimen, linearize, load_arm
from hmtb_twin.parameters.values import LARGE_MOTION


@dataclass(frozen=True)
class BinaryTest:
    """A short pseudo-random binary experiment, as plain as `simulate` accepts."""

    name: str = "binary"
    axes: tuple[str, ...] = ("elbow_pitch",)
    seed: int = 1
    duration: float = 4.0
    amplitude: float = 1.0
    hold: int = 5
    variant: str = "nominal"
    payload: str = "rpcm"
    plant: Plant = Plant()  # noqa: RUF009
    specimen: Specimen = Specimen()  # noqa: RUF009
    pose: str = "rpcm_holster_out_approach"
    mode: str = "single_joint"
    worksite: bool = False
    shutdown: tuple[float, ...] = ()
    payload_changes: tuple[PayloadChange, ...] = ()
    chain: Chain = Chain()  # noqa: RUF009
    hand_controller: HandController = LARGE_MOTION
    spoil: dict[int, float] = field(default_factory=dict)

    def volts(self):
        ticks = round(50 * self.duration)
        bits = np.random.default_rng(7).choice([-1.0, 1.0], (ticks // self.hold + 1, len(self.axes)))
        volts = self.amplitude * np.repeat(bits, self.hold, axis=0)[:ticks]
        for row, value in self.spoil.items():
            volts[row] = value
        return volts

    def operator(self):
        return None


@pytest.fixture(scope="session")
def arm():
    return load_arm()


@pytest.fixture(scope="session")
def truth(arm):
    return linearize(arm)


@pytest.fixture(scope="session")
def experiment():
    return BinaryTest
