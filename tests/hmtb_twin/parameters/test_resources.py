"""Model files are found from a checkout; tests/test_wheel.py does the same from an installed wheel."""

from pathlib import Path

import pytest

from hmtb_twin.parameters.errors import TwinError
from hmtb_twin.parameters.resources import model_file, models_directory


def test_the_checkout_uses_the_models_at_its_root() -> None:
    assert models_directory() == Path(__file__).parents[3] / "models"


def test_an_unknown_model_lists_those_that_exist() -> None:
    with pytest.raises(TwinError, match=r"'hmtb/other\.xml'.*available: .*hmtb/hmtb\.xml"):
        model_file("hmtb/other.xml")


def test_the_arm_and_its_world_are_there() -> None:
    for name in ("hmtb/hmtb.xml", "hmtb/scene.xml"):
        assert model_file(name).is_file()
