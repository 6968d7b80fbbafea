"""Seeds that nobody guesses, and specs that have them."""

from dataclasses import replace

import pytest

from scenarios.datasets.challenge_secret import secret_spec
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.errors import ScenarioError
from tests.scenarios.conftest import Class


def test_a_secret_seed_is_drawn_unless_it_is_given(hidden: Class) -> None:
    one, other = secret_spec(hidden.spec), secret_spec(hidden.spec)
    assert one.secret_seed != other.secret_seed and len(one.secret_seed) == 32 and one.seed is None
    assert all(block.draw_waveforms for block in one.records)
    given = "7a" * 16
    assert secret_spec(replace(hidden.spec, seed=None, secret_seed=given)).secret_seed == given
    seeds = {entry.experiment.seed for entry in DataSetPlan(one)}
    assert len(seeds) == 3 and max(seeds) > 2**32


def test_a_spec_has_one_source_of_chance(hidden: Class) -> None:
    for change in ({"seed": None}, {"secret_seed": "a" * 32}, {"commitment": "b" * 64}):
        with pytest.raises(ScenarioError, match="of seed, secret_seed and commitment given, expected one"):
            replace(hidden.spec, **change)  # type: ignore[arg-type]
    with pytest.raises(ScenarioError, match="expected 32 digits") as caught:
        replace(hidden.spec, seed=None, secret_seed="abc")
    assert "abc" not in str(caught.value)
    secret = replace(hidden.spec, seed=None, secret_seed="c" * 32, student="ann")
    assert DataSetSpec.from_toml(secret.to_toml()) == secret
