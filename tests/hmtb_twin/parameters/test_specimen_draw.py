import tomllib
from dataclasses import fields, replace
from zlib import crc32

import numpy as np
import pytest
from scipy import stats

from hmtb_twin import NOMINAL_SPECIMEN, Plant, Specimen, load_arm
from hmtb_twin.parameters.specimen_draw import CUT, Distribution, TwinDistributions, draw_specimen
from tests.refusals import refused

POPULATION = TwinDistributions(
    mass=Distribution("lognormal", 0.05),
    stretch=Distribution("normal", 0.1),
    shift=Distribution("uniform", 0.2),
    payload_mass=Distribution("fixed", centre=1.2),
    kp=Distribution("normal", 0.05, 1.02),
    supply_pressure=Distribution("uniform", 3.0),
    process_noise=Distribution("lognormal", 0.3, 0.005),
)


def test_the_same_seed_draws_the_same_arm_and_another_one_another():
    seed = np.random.SeedSequence(7, spawn_key=(2,))
    specimen, changes = draw_specimen(POPULATION, seed)
    assert draw_specimen(POPULATION, seed) == (specimen, changes)
    stream = np.random.SeedSequence(7, spawn_key=(2, crc32(b"mass")))
    normal = np.random.Generator(np.random.PCG64(stream)).standard_normal(8)
    np.testing.assert_allclose(specimen.mass, np.exp(0.05 * normal), rtol=1e-14)
    others = [draw_specimen(POPULATION, other)[0].mass for other in seed.spawn(3)]
    assert len({specimen.mass, *others}) == 4
    assert changes.keys() == {"supply_pressure", "process_noise"}
    assert load_arm(plant=Plant(**changes), specimen=specimen).specimen == specimen


@pytest.mark.parametrize("gone", POPULATION.stated)
def test_a_distribution_less_changes_nothing_of_the_others(gone):
    seed = np.random.SeedSequence(7)
    nominal = {**vars(NOMINAL_SPECIMEN), "supply_pressure": None, "process_noise": None}
    draws = (draw_specimen(population, seed) for population in (POPULATION, replace(POPULATION, **{gone: None})))
    before, after = ({**nominal, **vars(specimen), **changes} for specimen, changes in draws)
    assert before[gone] != nominal[gone]
    assert after == {**before, gone: nominal[gone]}
    # Quantities of one distribution are drawn apart.
    specimen, _ = draw_specimen(replace(POPULATION, kd=POPULATION.kp), seed)
    assert not set(specimen.kp) & set(specimen.kd)


@pytest.mark.parametrize(
    ("distribution", "known"),
    [
        (Distribution("normal", 2.0, 5.0), stats.truncnorm(-CUT, CUT, 5.0, 2.0)),
        (Distribution("uniform", 2.0, 5.0), stats.uniform(3.0, 4.0)),
        (Distribution("lognormal", 0.5, 5.0), stats.lognorm(0.5, scale=5.0)),
    ],
)
def test_numbers_have_their_distribution_within_its_support(distribution, known):
    numbers = distribution.draw(100_000, np.random.default_rng(0))
    assert stats.kstest(numbers, known.cdf).pvalue > 0.01
    lower, upper = distribution.support()
    assert lower <= numbers.min() < numbers.max() <= upper
    if distribution.kind != "uniform":
        # Uncut, six of so many normal numbers would be beyond.
        assert stats.binom(100_000, 2.0 * stats.norm.sf(CUT)).cdf(0) < 0.01


def test_they_are_written_and_read_as_a_table():
    text = POPULATION.to_toml()
    assert 'kp = { kind = "normal", spread = 0.05, centre = 1.02 }' in text
    assert 'mass = { kind = "lognormal", spread = 0.05 }' in text
    assert TwinDistributions.from_table(tomllib.loads(text)) == POPULATION
    assert hash(TwinDistributions.from_table(tomllib.loads(text))) == hash(POPULATION)
    assert TwinDistributions.from_table({}) == TwinDistributions()
    assert draw_specimen(TwinDistributions(), np.random.SeedSequence(0)) == (NOMINAL_SPECIMEN, {})
    # Every quantity of a specimen may scatter.
    names = {entry.name for entry in fields(TwinDistributions)}
    assert names > {entry.name for entry in fields(Specimen)}
    everything = TwinDistributions(**{name: Distribution("uniform", 0.001) for name in names - {"process_noise"}})
    specimen, changes = draw_specimen(everything, np.random.SeedSequence(0))
    assert set(specimen.deviations) | set(changes) | {"process_noise"} == names


def test_what_no_population_can_be_is_refused():
    for name, kind, message in (
        ("weight", "fixed", "^distributions: unknown key 'weight', available: mass, stretch"),
        ("shift", "lognormal", "^shift: centre = 0 of a lognormal distribution given"),
        ("process_noise", "normal", "^process_noise from -1.2 to 1.2 would be drawn: plant"),
    ):
        refused(message, TwinDistributions.from_table, {name: {"kind": kind, "spread": 0.3}})
    refused("without a centre", Distribution("normal", 0.1).draw, 1, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("mass", "message"),
    [
        ({"kind": "normal", "sigma": 0.1}, "^mass: unknown key 'sigma', available: kind, spread, centre$"),
        ({"spread": 0.1}, "^mass without a kind given, expected one of fixed, normal, uniform, lognormal$"),
        ({"kind": "gamma"}, "^mass: unknown kind 'gamma' of distribution, available: fixed, normal"),
        ({"kind": "normal"}, "^mass: spread = 0 of a normal distribution given, expected above 0$"),
        ({"kind": "fixed", "spread": 0.1}, "^mass: spread = 0.1 of a fixed distribution given, expected none$"),
        ({"kind": "normal", "spread": True}, "^mass: spread = True of a distribution given, expected a finite"),
        ({"kind": "normal", "spread": np.inf}, "spread = inf of a distribution given, expected a finite"),
        (0.1, "^mass = 0.1 given, expected a table of kind, spread, centre$"),
        ({"kind": "normal", "spread": 0.3}, r"^mass from -0.2 to 2.2 would be drawn: specimen: mass\[0\] = -0"),
        ({"kind": "lognormal", "spread": 1e9}, "^mass from 0 to inf would be drawn: specimen"),
    ],
)
def test_what_no_distribution_can_be_is_refused(mass, message):
    refused(message, TwinDistributions.from_table, {"mass": mass})
