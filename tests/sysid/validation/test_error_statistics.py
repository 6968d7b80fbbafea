import numpy as np
import pytest
from scipy.stats import binom

from sysid.models.frequency_response import NORMAL_95
from sysid.validation.mean_error import mean_error
from sysid.validation.monte_carlo import exact_interval_of_share, interval_of_mean_share, interval_of_positive_mean
from sysid.validation.response_errors import (
    covered_share,
    free_parts,
    normalised_error,
    normalised_square,
    real_and_imaginary,
    variance_ratio,
    variance_ratio_by_frequency,
)
from sysid.validation.systematic_error import scatter_of, systematic_of

RUNS = 200


@pytest.mark.slow
@pytest.mark.parametrize(("records", "directions", "shift"), [(40, 4, 0.0), (15, 2, 0.0), (40, 3, 0.5)])
def test_a_mean_as_large_as_allowed_is_beyond_the_limit_as_often_as_asked(records, directions, shift):
    rng = np.random.default_rng(7)
    mixing = rng.standard_normal((directions, directions)) + 3.0 * np.eye(directions)
    beyond = inside = 0
    for _ in range(RUNS):
        errors = rng.standard_normal((records, directions))
        errors[:, 0] += shift
        judged = mean_error(errors @ mixing, 0.05, shift)
        beyond += judged.size > judged.limit
        inside += judged.interval[0] <= shift <= judged.interval[1]
    assert beyond / RUNS == pytest.approx(0.05, abs=0.046)
    assert inside / RUNS >= 0.904


@pytest.mark.slow
@pytest.mark.parametrize(("shift", "least", "most"), [(1.2, 0.99, 1.0), (0.2, 0.0, 0.1), (0.0, 0.0, 0.05)])
def test_what_is_larger_is_judged_and_what_is_smaller_is_not(shift, least, most):
    rng = np.random.default_rng(8)
    runs_of_errors = [rng.standard_normal((40, 4)) + np.array([shift, 0.0, 0.0, 0.0]) for _ in range(RUNS)]
    judged = [mean_error(errors, 0.05, 0.2) for errors in runs_of_errors]
    assert least <= np.mean([one.size > one.limit for one in judged]) <= most


def test_errors_without_scatter():
    ramp = np.arange(10.0) - 4.5
    for first, second, size in ((0.0, 0.0, 0.0), (3.0, 3.0, np.inf), (3.0, ramp, np.inf), (0.0, ramp, 0.0)):
        errors = np.column_stack((np.full(10, first), np.broadcast_to(second, 10)))
        assert mean_error(errors, 1e-3).size == size


LINES = 20


def normal(rng, *shape):
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2.0)


def test_noise_and_distortion_are_distinguished():
    rng = np.random.default_rng(1)
    groups = [1.0 + 0.03 * normal(rng, LINES) + 0.01 * normal(rng, 3, LINES) for _ in range(60)]
    scatter = scatter_of(groups, LINES)
    assert scatter.noise == pytest.approx(1.0, rel=0.05)
    assert scatter.distortion == pytest.approx(3.0, rel=0.05)
    assert scatter.noise_interval[0] < 1.0 < scatter.noise_interval[1]
    assert scatter.distortion_interval[0] < 3.0 < scatter.distortion_interval[1] < 4.0


def test_without_repeats_the_noise_is_unknown():
    scatter = scatter_of(list(normal(np.random.default_rng(1), 6, 1, LINES)), LINES)
    assert np.isnan((scatter.noise, *scatter.noise_interval)).all()
    assert scatter.distortion == pytest.approx(100.0, rel=0.2)


def test_a_systematic_error_is_free_of_what_scatter_adds():
    errors = 0.04 + 0.05 * normal(np.random.default_rng(2), 200, LINES)
    strict, lenient = (systematic_of(errors, LINES, allowed=allowed, false_alarm=1e-4) for allowed in (2.0, 5.0))
    assert strict.size == pytest.approx(4.0, rel=0.05)
    assert strict.interval[0] < 4.0 < strict.interval[1]
    assert strict.limit < strict.size < lenient.limit


def test_the_limit_follows_the_noise_and_no_verdict_depends_on_its_level():
    errors = normal(np.random.default_rng(3), 8, LINES)
    one, ten = (systematic_of(scale * errors, LINES, allowed=0.0, false_alarm=1e-3) for scale in (1.0, 10.0))
    assert (ten.limit, ten.size) == pytest.approx((10.0 * one.limit, 10.0 * one.size))


@pytest.mark.slow
@pytest.mark.parametrize("directions", [1, 3, LINES])
def test_false_alarms_are_no_more_than_stated(directions):
    rng = np.random.default_rng(4)
    mixing = rng.standard_normal((directions, LINES)) if directions < LINES else np.eye(LINES)
    runs, stated = 600, 0.05

    def alarms(allowed):
        count = 0
        for _ in range(runs):
            shift = rng.standard_normal(LINES)
            shift *= allowed / 100.0 * np.sqrt(LINES) / np.linalg.norm(shift)
            errors = (shift + 0.1 * rng.standard_normal((6, directions)) @ mixing).astype(complex)
            error = systematic_of(errors, LINES, allowed=allowed, false_alarm=stated)
            count += error.size > error.limit
        return count

    # three standard deviations above what is stated
    assert alarms(3.0) <= runs * stated + 3.0 * np.sqrt(runs * stated)
    if directions == 1:
        assert alarms(0.0) > 0.5 * runs * stated, "no verdict that never fails"


def test_the_same_error_in_all_waveforms_has_no_scatter_to_hide_in():
    error = systematic_of(np.full((6, LINES), 0.06 + 0j), LINES, allowed=5.0, false_alarm=1e-6)
    assert (error.size, error.limit, *error.interval) == pytest.approx((6.0, 5.0, 6.0, 6.0))


COVARIANCE = np.array([[[[[4.0, 1.0], [1.0, 2.0]]]], [[[[9.0, 0.0], [0.0, 0.0]]]]])


def test_values_by_hand():
    errors = real_and_imaginary(np.array([[[[2.0 + 1.0j]], [[6.0 + 0.0j]]]]))
    free = free_parts(COVARIANCE)
    assert free.tolist() == [[[[True, True]]], [[[True, False]]]]  # a part that cannot vary is left out
    assert variance_ratio_by_frequency(errors, COVARIANCE, free)[0, :, 0, 0] == pytest.approx([5.0 / 6.0, 4.0])
    assert variance_ratio(errors, COVARIANCE, free) == pytest.approx([(5.0 / 6.0 + 4.0) / 2.0])
    # [2 1] inv([[4 1] [1 2]]) [2 1]' = (2*4 - 2*2 + 4*1) / 7 of two parts, 36 / 9 of one
    assert normalised_square(errors, COVARIANCE, free) == pytest.approx([(8.0 / 7.0 / 2.0 + 4.0) / 2.0])
    # 6 is more than 1.96 times 3; the part that does not vary is not counted
    assert covered_share(errors, COVARIANCE, free) == pytest.approx([2.0 / 3.0])


@pytest.mark.parametrize(
    ("statistic", "claimed", "value"),
    [
        # no covariances
        *(
            (normalised_square, claimed, np.inf)
            for claimed in (np.zeros((2, 2)), np.ones((2, 2)), np.diag([1.0, -1.0]))
        ),
        # nothing is covered by intervals of no width
        *((covered_share, variance * np.eye(2), 0.0) for variance in (0.0, -1.0)),
        (covered_share, 1.01 / NORMAL_95**2 * np.eye(2), 1.0),
    ],
)
def test_claims_at_the_edge(statistic, claimed, value):
    covariance, free = np.broadcast_to(claimed, (2, 1, 1, 2, 2)), np.ones((2, 1, 1, 2), dtype=bool)
    assert statistic(np.ones((1, 2, 1, 1, 2)), covariance, free) == pytest.approx([value])


def test_the_normalised_error_of_parameters_of_any_size():
    covariance = np.array([[4.0, 1e-8], [1e-8, 1e-16]])
    error = np.array([2.0, 1e-8])
    assert normalised_error(error, covariance) == pytest.approx(error @ np.linalg.solve(covariance, error))
    assert normalised_error(error, np.diag([1.0, 0.0])) == np.inf
    assert normalised_error(error, np.ones((2, 2))) == np.inf


SETS = 800


def held(interval, sets, true):
    ends = np.array([interval(values) for values in sets])
    return float(np.mean((ends[:, 0] <= true) & (true <= ends[:, 1])))


@pytest.mark.thorough
@pytest.mark.parametrize("records", [4, 20, 200])
@pytest.mark.parametrize("freedom", [2, 4, 8])
def test_positive_means_are_held(records, freedom):
    rng = np.random.default_rng(5)
    values = np.asarray(rng.chisquare(freedom, (SETS, records)) / freedom)
    assert 0.93 <= held(interval_of_positive_mean, values, 1.0) <= 0.97


def test_positive_means_are_held_from_above_and_below():
    low, high = interval_of_positive_mean(np.array([0.8, 1.2, 0.5, 100.0, 0.9]))
    assert 0.0 < low < 20.68 < 100.0 < high
    assert interval_of_positive_mean(np.full(5, 2.0)) == (2.0, 2.0)
    assert interval_of_positive_mean(np.zeros(5)) == (0.0, 0.0)
    # hardly any scatter: as the normal distribution has it
    low, high = interval_of_positive_mean(np.linspace(1.0, 1.0 + 199e-9, 200))
    assert high - low == pytest.approx(2.0 * 1.972 * 1e-9 * np.std(np.arange(200), ddof=1) / 200**0.5, rel=0.01)


@pytest.mark.parametrize("values", [np.array([1.0, 2.0]), np.array([1.0, 2.0, np.inf]), np.array([1.0, np.nan, 2.0])])
def test_of_too_few_or_infinite_values_no_interval_is_told(values):
    assert np.isnan(interval_of_positive_mean(values)).all()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [1e-300, 1e200, 1e300])
def test_positive_means_of_any_size_are_alike(size):
    values = np.array([1.0, 2.0, 6.0])
    assert np.array(interval_of_positive_mean(size * values)) / size == pytest.approx(interval_of_positive_mean(values))


def test_shares_have_a_width_at_both_ends():
    least = 0.025 ** (1.0 / 8.0)
    assert interval_of_mean_share(np.ones(8)) == (pytest.approx(least), 1.0)
    assert interval_of_mean_share(np.zeros(8)) == (0.0, pytest.approx(1.0 - least))
    assert interval_of_mean_share(np.ones(1)) == (pytest.approx(0.025), 1.0)
    assert np.isnan(interval_of_mean_share(np.empty(0))).all()
    assert np.isnan(interval_of_mean_share(np.array([0.5, np.nan]))).all()


def test_shares_of_one_each_have_the_exact_interval():
    yes_and_no = np.repeat([1.0, 0.0], [18, 2])
    assert interval_of_mean_share(yes_and_no) == pytest.approx(exact_interval_of_share(18, 20))
    many = np.full(20, 0.9) + 0.05 * np.resize([1.0, -1.0], 20)
    low, high = interval_of_mean_share(many)
    assert 0.0 < high - low < 0.08
    assert low < 0.9 < high


@pytest.mark.thorough
@pytest.mark.parametrize("records", [4, 20, 200])
@pytest.mark.parametrize("together", [1, 5, 40])
def test_shares_are_held(records, together):
    rng = np.random.default_rng(6)
    # things of a record go together: its own share is between 0 and 1, 0.9 in the mean
    own = rng.beta(0.9 * together, 0.1 * together, (SETS, records))
    values = rng.binomial(together, own) / together
    assert held(interval_of_mean_share, values, 0.9) >= 0.93


@pytest.mark.parametrize(("found", "total"), [(0, 20), (3, 20), (20, 20)])
def test_interval_of_a_share(found, total):
    low, high = exact_interval_of_share(found, total)
    assert low <= found / total <= high
    if found:
        assert binom.sf(found - 1, total, low) == pytest.approx(0.025)
    if found < total:
        assert binom.cdf(found, total, high) == pytest.approx(0.025)
