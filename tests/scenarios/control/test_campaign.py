"""Models for control from files; those from records are in the tests of `hmtb control`."""

import numpy as np
import pytest

import sysid
from scenarios.control.campaign import identify_pair, read_model
from sysid import StateSpace
from tests.refusals import refused


def model(m: int = 6, dt: float = 0.02) -> StateSpace:
    """Each joint a first-order lag of one sample's delay."""
    return StateSpace(0.9 * np.eye(m), 0.1 * np.eye(m), np.eye(m), np.zeros((m, m)), None, dt, np.eye(m))


@pytest.mark.parametrize("wrong", [model(5), model(dt=0.1)])
def test_references_of_other_channels_are_refused(tmp_path, wrong):
    path = sysid.write_model(wrong, tmp_path / "wrong.json")
    refused("wrong.json: a model of .* expected 6 joints .* at 0.02 s", read_model, path)
    refused("unknown reference 'fligth': did you mean 'flight'", identify_pair, reference="fligth")
