"""Models for control from records and files."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
from hmtb_twin import simulate
from scenarios.control.campaign import CONTROLLED, EXCITATION, identification_experiment, identify_pair, read_model
from sysid import StateSpace
from tests.refusals import refused

SHORT = replace(EXCITATION, period=20.0, periods=2)


@pytest.fixture(scope="module")
def short_record(tmp_path_factory):
    experiment = replace(identification_experiment(), multisines=SHORT)
    return simulate([experiment])[0].save(tmp_path_factory.mktemp("control") / "ground.nc")


def model(m: int = 6, dt: float = 0.02) -> StateSpace:
    """Each joint a first-order lag of one sample's delay."""
    return StateSpace(0.9 * np.eye(m), 0.1 * np.eye(m), np.eye(m), np.zeros((m, m)), None, dt, np.eye(m))


def test_files_stand_for_both_arms(short_record, tmp_path):
    sysid.write_model(model(), tmp_path / "reference.json")
    pair = identify_pair(ground=short_record, reference=tmp_path / "reference.json")
    np.testing.assert_allclose(pair.reference.A, 0.9 * np.eye(6))
    assert (pair.ground.order, pair.ground.nu, pair.ground.ny) == (18, 6, 6)
    assert not pair.ground.D.any()
    # Every joint follows its own command slowly.
    np.testing.assert_allclose(np.diag(pair.ground.dc_gain()), 1.0, atol=0.1)
    assert pair.record.input_names == tuple(f"{name} commanded" for name in CONTROLLED)


def test_references_of_other_channels_are_refused(tmp_path):
    refused("unknown reference 'fligth': did you mean 'flight'", identify_pair, reference="fligth")
    for name, wrong in (("few", model(5)), ("slow", model(dt=0.1))):
        sysid.write_model(wrong, tmp_path / f"{name}.json")
        refused(f"{name}.json: a model of .* expected 6 joints .* at 0.02 s", read_model, tmp_path / f"{name}.json")
