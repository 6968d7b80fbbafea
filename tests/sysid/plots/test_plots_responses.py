import io
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.colors import to_hex

import sysid
import sysid.plots
from sysid import FrequencyResponse, IOData, StateSpace
from sysid.plots import PALETTE, Curve, Roots, Trace, bode, impulse, pzmap, show, spectra, step
from tests.refusals import refused
from tests.sysid.plots.figures import DATA, MODEL, labels

F = np.geomspace(0.05, 25, 40)
TWO = StateSpace(
    np.diag([0.9, 0.5]),
    [[0.1, 0.2], [0.3, 0.1]],
    [[1.0, 0.5], [0.0, 1.0]],
    np.zeros((2, 2)),
    None,
    0.02,
    0.01 * np.eye(2),
    input_names=("roll", "pitch"),
    output_names=("wrist", "elbow"),
)


@pytest.fixture(scope="module")
def several():
    rng = np.random.default_rng(1)
    u = rng.standard_normal((500, 2))
    y = sysid.simulate(TWO, u, rng=rng)
    return IOData(u, y, 0.02, input_names=TWO.input_names, output_names=TWO.output_names)


def assert_renders(figure):
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg")
    assert len(buffer.getvalue()) > 1000


@pytest.mark.slow
def test_plots_come_with_the_package_when_they_are_asked_for():
    script = (
        "import sys, sysid\n"
        "assert 'sysid.plots' not in sys.modules and 'plots' in dir(sysid)\n"
        "assert callable(sysid.plots.bode)\n"
        "try: sysid.nonsense\n"
        "except AttributeError as error: assert 'nonsense' in str(error)\n"
        "else: raise SystemExit(1)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


def test_palette_tells_everything_apart():
    assert len({style.colour for style in PALETTE.values()}) == len(PALETTE)


def test_bode_draws_decibels_and_degrees_over_hertz():
    value = MODEL.frequency_response(F)
    covariance = np.broadcast_to(1e-4 * np.eye(2), (len(F), 1, 1, 2, 2)).copy()
    curves = [
        Curve("truth", FrequencyResponse(F, value, 0.02, "truth")),
        Curve("estimate", FrequencyResponse(F, value, 0.02, "oe", covariance=covariance)),
    ]
    figure = bode(curves, relative_to_dc=True, mark_hz=1.0, limits_hz=(0.1, 25))
    upper, lower = figure.axes
    truth, estimate = upper.get_lines()[:2]
    np.testing.assert_allclose(truth.get_ydata(), 20 * np.log10(np.abs(value[:, 0, 0])))
    np.testing.assert_allclose(lower.get_lines()[0].get_ydata(), np.degrees(np.unwrap(np.angle(value[:, 0, 0]))))
    assert (to_hex(truth.get_color()), to_hex(estimate.get_color())) == (PALETTE["truth"].colour, PALETTE["oe"].colour)
    assert len(upper.collections) == len(lower.collections) == 1  # the band of the one that has a covariance
    assert upper.get_xscale() == "log"
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("magnitude / dB", "phase / degrees")
    assert lower.get_xlabel() == "frequency / Hz"
    assert labels(figure) == ["truth", "estimate"]
    assert_renders(figure)


def test_bode_takes_records_as_they_come():
    oe, arx = sysid.oe(DATA, 1, 1, 1), sysid.arx(DATA, 1, 1, 1)
    figure = bode([sysid.spa(DATA), oe, arx, MODEL])
    upper, _ = figure.axes
    assert labels(figure) == ["SPA", "OE nb 1, nf 1, nk 1", "ARX na 1, nb 1, nk 1", "model"]
    colours = [to_hex(line.get_color()) for line in upper.get_lines()]
    assert colours[:3] == [PALETTE[method].colour for method in ("spa", "oe", "arx")]
    assert len(set(colours)) == 4
    np.testing.assert_allclose(upper.get_lines()[1].get_xdata()[[0, -1]], [0.025, 25.0])  # up to Nyquist
    assert labels(bode(oe)) == ["OE nb 1, nf 1, nk 1"]
    assert labels(bode({"mine": oe, "true": MODEL})) == ["mine", "true"]
    twice = bode([oe, oe], frequencies=F)
    assert labels(twice) == ["OE nb 1, nf 1, nk 1", "OE nb 1, nf 1, nk 1 (2)"]
    first, second = twice.axes[0].get_lines()
    assert to_hex(first.get_color()) != to_hex(second.get_color())
    np.testing.assert_allclose(first.get_xdata(), F)


def test_pole_zero_map_of_estimates_and_models_counts_what_lies_outside():
    far = StateSpace([[0.9, 1.0], [-0.2, 0.0]], [[0.1], [0.3]], [[1.0, 0.0]], [[0.0]], None, 0.02)
    np.testing.assert_allclose(far.zeros(), [-3.0])
    oe = sysid.oe(DATA, 1, 1, 1)
    figure = pzmap([oe, MODEL, Roots("near", MODEL, PALETTE["truth"]), Roots("far", far, PALETTE["oe"])])
    assert labels(figure) == ["OE nb 1, nf 1, nk 1", "model", "near", "far (1 zero beyond the frame)"]
    crosses = [line for line in figure.axes[0].get_lines() if line.get_marker() == "x"]
    for line, model in zip(crosses, (oe.model, MODEL, MODEL), strict=False):
        np.testing.assert_allclose(line.get_xdata(), model.poles().real)
    assert labels(pzmap({"mine": oe})) == ["mine"]
    assert_renders(figure)


def test_poles_of_estimates_have_their_regions():
    estimate = sysid.armax(DATA, 1, 1, 1)
    outline = sysid.models.poles_band(estimate).ellipses()[0]
    lines = pzmap(estimate).axes[0].get_lines()
    np.testing.assert_allclose(lines[-1].get_xdata(), outline.real)
    assert to_hex(lines[-1].get_color()) == PALETTE["armax"].colour
    assert len(pzmap(estimate, regions=False).axes[0].get_lines()) == len(lines) - 1


def test_a_step_response_has_its_band():
    estimate = sysid.oe(DATA, 1, 1, 1)
    figure = step([estimate, MODEL], length=1.0)
    (axes,) = figure.axes
    _, line, true = axes.get_lines()
    np.testing.assert_allclose(line.get_xdata(), 0.02 * np.arange(51), atol=1e-12)
    np.testing.assert_allclose(line.get_ydata(), estimate.model.step_response(51)[:, 0, 0])
    np.testing.assert_allclose(true.get_ydata(), MODEL.step_response(51)[:, 0, 0])
    (band,) = axes.collections
    edges = sysid.band(estimate, lambda model: model.step_response(51)).ci95
    assert band.get_paths()[0].vertices[:, 1].max() == pytest.approx(edges[1].max())
    assert labels(figure) == ["OE nb 1, nf 1, nk 1", "model"]
    assert (axes.get_ylabel(), axes.get_xlabel()) == ("step response / (rad/V)", "time / s")
    assert not step(sysid.n4sid(DATA, 1)).axes[0].collections  # its covariance is unknown
    refused("length must be above 0 s, got -1", lambda: step(MODEL, length=-1))


def test_a_pulse_response_is_drawn_until_it_has_died_out():
    samples = impulse(MODEL).axes[0].get_lines()[1].get_ydata()
    assert 0.001 * samples.max() < samples[-1] < 0.01 * samples.max()
    integrator = StateSpace([[1.0]], [[1.0]], [[1.0]], [[0.0]], None, 0.1)
    assert len(impulse(integrator).axes[0].get_lines()[1].get_xdata()) == 101


def test_correlation_analysis_is_drawn_with_its_deviation():
    analysis = sysid.cra(DATA, lags=30)
    figure = impulse([analysis, MODEL])
    (axes,) = figure.axes
    np.testing.assert_allclose(axes.get_lines()[1].get_ydata(), analysis.response[:, 0, 0])
    (band,) = axes.collections
    top = (analysis.response + 1.959963984540054 * analysis.deviation).max()
    assert band.get_paths()[0].vertices[:, 1].max() == pytest.approx(top)
    assert labels(figure) == ["correlation analysis", "model"]
    summed = step({"correlations": analysis}).axes[0]
    np.testing.assert_allclose(summed.get_lines()[1].get_ydata(), np.cumsum(analysis.response[:, 0, 0]))
    assert not summed.collections


@pytest.mark.slow
def test_all_channels_or_those_chosen(several):
    estimate = sysid.okid(several, 2, p=4)
    channels = ["roll → wrist", "pitch → wrist", "roll → elbow", "pitch → elbow"]
    assert [axes.get_title(loc="left") for axes in step([estimate, TWO]).axes] == channels
    (axes,) = step(TWO, output="elbow", input=0).axes
    np.testing.assert_allclose(axes.get_lines()[1].get_ydata()[:10], TWO.step_response(10)[:, 1, 0])
    every = bode([sysid.spa(several), estimate])
    assert len(every.axes) == 8
    line = every.axes[3].get_lines()[1]
    phase = estimate.frequency_response(line.get_xdata()).phase[:, 0, 1]
    np.testing.assert_allclose(line.get_ydata(), np.degrees(phase))
    assert len(bode(estimate, output=1, input="pitch").axes) == 2
    refused(r"unknown output 'rist'; there are wrist, elbow \(0 to 1\)", lambda: bode(estimate, output="rist"))
    refused("unknown input 2", lambda: step(estimate, input=2))
    refused(r"same outputs and inputs; got model 2 x 2, model \(2\) 1 x 1", bode, [TWO, MODEL])
    refused("same outputs and inputs", step, [TWO, MODEL])


def test_a_best_linear_approximation_shows_noise_and_distortion():
    rng = np.random.default_rng(0)
    records = []
    for _ in range(3):
        phases = rng.uniform(0, 2 * np.pi, 15)
        period = sum(np.cos(2 * np.pi * (k + 1) * np.arange(100) / 100 + phases[k]) for k in range(15)) / 4
        u = np.tile(period, 4)
        x = sysid.simulate(MODEL, u)[:, 0]
        records.append(IOData(u, x + 0.5 * x**3 + 1e-4 * rng.standard_normal(400), 0.02, window=100))
    approximation = sysid.bla(records, 100)
    figure = bode([approximation, MODEL])
    assert labels(figure) == ["BLA", "noise, one realisation", "distortion, one realisation", "model"]
    response, noise, distortion, _ = figure.axes[0].get_lines()
    np.testing.assert_allclose(response.get_ydata(), 20 * np.log10(approximation.response.magnitude[:, 0, 0]))
    np.testing.assert_allclose(noise.get_ydata(), 10 * np.log10(3 * approximation.noise_variance[:, 0, 0]))
    variance = approximation.distortion_variance[:, 0, 0]
    known = variance > 0
    np.testing.assert_allclose(distortion.get_ydata()[known], 10 * np.log10(variance[known]))
    assert labels(bode(sysid.bla(records[0], 100))) == ["BLA", "noise, one realisation"]


def test_spectra_of_the_disturbance_with_their_intervals(several):
    estimate = sysid.spa(DATA)
    figure = spectra(estimate, unit="rad")
    output, inputs = figure.axes
    assert labels(figure) == ["measured", "SPA, disturbance"]
    keep = estimate.frequencies > 0
    np.testing.assert_allclose(output.get_lines()[0].get_ydata(), estimate.output_spectrum[keep, 0, 0].real)
    np.testing.assert_allclose(inputs.get_lines()[0].get_ydata(), estimate.input_spectrum[keep, 0, 0].real)
    assert len(output.collections) == 1
    assert (output.get_ylabel(), inputs.get_ylabel()) == ("output, density / (rad²/Hz)", "input, density")
    oe = sysid.oe(DATA, 1, 1, 1)
    (both,) = spectra([estimate, oe]).axes
    np.testing.assert_allclose(both.get_lines()[1].get_ydata(), 0.02 * oe.noise_variance[0, 0])
    assert len(spectra(sysid.spa(several)).axes) == 4
    assert len(spectra(sysid.spa(several), output="elbow").axes) == 1
    figure = spectra(np.linspace(0, 25, 26), [Trace("noise", np.ones(26), PALETTE["spa"])], unit="rad")
    assert figure.axes[0].get_lines()[0].get_xdata()[0] == 1.0  # zero frequency is left out
    assert figure.axes[0].get_ylabel() == "spectral density / (rad²/Hz)"
    bare = FrequencyResponse(np.ones(1), np.ones((1, 1, 1)), 0.02, "bare")
    refused("gives no spectrum of the disturbance", spectra, bare)


@pytest.mark.parametrize(
    ("draw", "thing", "message"),
    [
        (bode, "model", "cannot draw a str; expected Curve, FrequencyResponse, Estimate, StateSpace"),
        (bode, [], "nothing to draw"),
        (pzmap, [np.ones(3)], "cannot draw a ndarray; expected Roots, Estimate, StateSpace"),
        (spectra, MODEL, "cannot draw a StateSpace; expected FrequencyResponse, Estimate"),
        (impulse, DATA, "cannot draw a IOData; expected Estimate, StateSpace, ImpulseResponse"),
    ],
)
def test_what_cannot_be_drawn_is_refused(draw, thing, message):
    refused(message, draw, thing)


def test_show_hands_the_figure_to_a_window(monkeypatch):
    shown = []
    monkeypatch.setattr(pyplot, "show", lambda: shown.extend(pyplot.get_fignums()))
    before = len(pyplot.get_fignums())
    figure = step(MODEL)
    show(figure)
    assert len(shown) == before + 1
    assert figure.canvas.manager is not None
    pyplot.close("all")


def test_a_finite_impulse_response_ends_with_its_last_coefficient():
    lines = impulse([sysid.impulseest(DATA, 30), MODEL]).axes[0].get_lines()[1:]
    assert [len(line.get_xdata()) for line in lines] == [30, 52]


def test_bode_draws_intervals_with_distortion_and_order():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(1500)
    data = IOData(u, sysid.simulate(MODEL, u) + 0.01 * rng.standard_normal((1500, 1)), 0.02)
    estimate = sysid.oe(data, 1, 1, 1)
    error = sysid.model_error(estimate, data, F)
    figure = bode(estimate, error=error)
    upper, _ = figure.axes
    drawn = [line.get_ydata() for line in upper.get_lines()]
    for end in error.interval:
        decibels = 20 * np.log10(end[:, 0, 0])
        assert any(len(values) == len(F) and np.allclose(values, decibels) for values in drawn)
    assert "95 % with distortion and order" in labels(figure)
    assert_renders(figure)


def test_an_interval_that_leads_far_away_does_not_flatten_the_curves():
    rng = np.random.default_rng(0)
    u = rng.choice([-1.0, 1.0], (1500, 1))
    data = IOData(u, sysid.simulate(MODEL, u) + 0.01 * rng.standard_normal((1500, 1)), 0.02)
    estimate = sysid.oe(data, 1, 1, 1)
    error = sysid.model_error(estimate, data, F)
    low, high = (end.copy() for end in error.interval)
    low[-5:], high[-5:] = 1e-9, 1e9
    narrow, wide = (bode(estimate, error=e).axes[0].get_ylim() for e in (error, replace(error, interval=(low, high))))
    assert wide[1] - wide[0] < narrow[1] - narrow[0] + 2 * 10.0 + 1e-9
    assert wide[0] < narrow[0] and wide[1] > narrow[1]


def test_a_value_between_unknown_ones_is_drawn_as_a_point():
    values = np.array([1.0, np.nan, 0.5, np.nan, 0.3, 0.2, np.nan])
    response = FrequencyResponse(np.arange(1.0, 8.0), values[:, None, None] + 0j, 0.02, "spa")
    upper, _ = bode(response).axes
    points = [line for line in upper.get_lines() if line.get_linestyle() == "None"]
    np.testing.assert_array_equal(points[0].get_xdata(), [1.0, 3.0])
    np.testing.assert_allclose(points[0].get_ydata(), 20 * np.log10([1.0, 0.5]))
    # nothing is unknown here
    assert all(line.get_linestyle() != "None" for line in bode(MODEL).axes[0].get_lines())
