"""Figures of responses: over time, of periodic data, of several channels."""

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import sysid
from sysid import IOData, StateSpace, SysidError
from sysid.plots import PALETTE, bode, impulse, pzmap, show, spectra, step
from tests.sysid.refusals import refused

MODEL = StateSpace([[0.9]], [[0.1]], [[1.0]], [[0.0]], None, 0.02)
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
def data() -> IOData:
    rng = np.random.default_rng(0)
    u = rng.standard_normal(600)
    noisy = StateSpace(MODEL.A, MODEL.B, MODEL.C, MODEL.D, None, 0.02, [[1e-4]])
    return IOData(u, sysid.simulate(noisy, u, rng=rng), 0.02, input_units=("V",), output_units=("rad",))


@pytest.fixture(scope="module")
def several() -> IOData:
    rng = np.random.default_rng(1)
    u = rng.standard_normal((500, 2))
    names = {"input_names": TWO.input_names, "output_names": TWO.output_names}
    return IOData(u, sysid.simulate(TWO, u, rng=rng), 0.02, **names)  # type: ignore[arg-type]


def labels(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.slow
def test_plots_come_with_the_package_when_they_are_asked_for() -> None:
    import subprocess
    import sys

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


def test_a_step_response_has_its_band(data: IOData) -> None:
    found = sysid.oe(data, 1, 1, 1)
    figure = step([found, MODEL], length=1.0)
    (axes,) = figure.axes
    _, line, true = axes.get_lines()
    np.testing.assert_allclose(line.get_xdata(), 0.02 * np.arange(51), atol=1e-12)
    np.testing.assert_allclose(line.get_ydata(), found.model.step_response(51)[:, 0, 0])
    np.testing.assert_allclose(true.get_ydata(), MODEL.step_response(51)[:, 0, 0])
    (band,) = axes.collections
    edges = sysid.band(found, lambda model: model.step_response(51)).ci95
    drawn = band.get_paths()[0].vertices
    assert drawn[:, 1].max() == pytest.approx(edges[1].max())
    assert labels(figure) == ["OE 1 1 1", "model"]
    assert axes.get_ylabel() == "step response / (rad/V)"
    assert axes.get_xlabel() == "time / s"


def test_a_pulse_response_is_drawn_until_it_has_died_out(data: IOData) -> None:
    (axes,) = impulse(MODEL).axes
    samples = axes.get_lines()[1].get_ydata()
    assert 0.001 * samples.max() < samples[-1] < 0.01 * samples.max()
    integrator = StateSpace([[1.0]], [[1.0]], [[1.0]], [[0.0]], None, 0.1)
    assert len(impulse(integrator).axes[0].get_lines()[1].get_xdata()) == 101


def test_correlation_analysis_is_drawn_with_its_deviation(data: IOData) -> None:
    found = sysid.cra(data, lags=30)
    figure = impulse([found, MODEL])
    (axes,) = figure.axes
    np.testing.assert_allclose(axes.get_lines()[1].get_ydata(), found.response[:, 0, 0])
    (band,) = axes.collections
    top = (found.response + 1.959963984540054 * found.deviation).max()
    assert band.get_paths()[0].vertices[:, 1].max() == pytest.approx(top)
    assert labels(figure) == ["correlation analysis", "model"]
    summed = step({"correlations": found}).axes[0]
    np.testing.assert_allclose(summed.get_lines()[1].get_ydata(), np.cumsum(found.response[:, 0, 0]))
    assert not summed.collections


def test_an_estimate_of_unknown_covariance_has_no_band(data: IOData) -> None:
    assert not step(sysid.n4sid(data, 1)).axes[0].collections


def test_all_channels_or_those_chosen(several: IOData) -> None:
    found = sysid.okid(several, 2, p=4)
    assert [axes.get_title(loc="left") for axes in step([found, TWO]).axes] == [
        "roll → wrist",
        "pitch → wrist",
        "roll → elbow",
        "pitch → elbow",
    ]
    (axes,) = step(TWO, output="elbow", input=0).axes
    np.testing.assert_allclose(axes.get_lines()[1].get_ydata()[:10], TWO.step_response(10)[:, 1, 0])
    every = bode([sysid.spa(several), found])
    assert len(every.axes) == 8
    np.testing.assert_allclose(
        every.axes[3].get_lines()[1].get_ydata(),
        np.degrees(found.frequency_response(every.axes[3].get_lines()[1].get_xdata()).phase[:, 0, 1]),
    )
    assert len(bode(found, output=1, input="pitch").axes) == 2
    refused(r"unknown output 'rist'; there are wrist, elbow \(0 to 1\)", lambda: bode(found, output="rist"))
    refused("unknown input 2", lambda: step(found, input=2))
    refused(r"same outputs and inputs; got model 2 x 2, model \(2\) 1 x 1", lambda: bode([TWO, MODEL]))
    refused("same outputs and inputs", lambda: step([TWO, MODEL]))


def test_a_best_linear_approximation_shows_noise_and_distortion() -> None:
    rng = np.random.default_rng(0)
    records = []
    for _ in range(3):
        phases = rng.uniform(0, 2 * np.pi, 15)
        period = sum(np.cos(2 * np.pi * (k + 1) * np.arange(100) / 100 + phases[k]) for k in range(15)) / 4
        u = np.tile(period, 4)
        x = sysid.simulate(MODEL, u)[:, 0]
        records.append(IOData(u, x + 0.5 * x**3 + 1e-4 * rng.standard_normal(400), 0.02, window=100))
    found = sysid.bla(records, 100)
    figure = bode([found, MODEL])
    assert labels(figure) == ["BLA", "noise, one realisation", "distortion, one realisation", "model"]
    response, noise, distortion, _ = figure.axes[0].get_lines()
    np.testing.assert_allclose(response.get_ydata(), 20 * np.log10(found.response.magnitude[:, 0, 0]))
    np.testing.assert_allclose(noise.get_ydata(), 10 * np.log10(3 * found.noise_variance[:, 0, 0]))
    known = found.distortion_variance[:, 0, 0] > 0
    np.testing.assert_allclose(distortion.get_ydata()[known], 10 * np.log10(found.distortion_variance[known, 0, 0]))
    single = bode(sysid.bla(records[0], 100))
    assert labels(single) == ["BLA", "noise, one realisation"]


def test_the_phase_of_data_stays_beside_that_of_a_model(data: IOData) -> None:
    turned = sysid.spa(data)
    figure = bode([MODEL, turned])
    model, measured = figure.axes[1].get_lines()
    beside = np.interp(measured.get_xdata(), model.get_xdata(), model.get_ydata())
    assert np.nanmax(np.abs(measured.get_ydata() - beside)) <= 180.0


def test_spectra_of_the_disturbance_with_their_intervals(data: IOData, several: IOData) -> None:
    found = sysid.spa(data)
    figure = spectra(found, unit="rad")
    output, inputs = figure.axes
    assert labels(figure) == ["measured", "SPA, disturbance"]
    keep = found.frequencies > 0
    np.testing.assert_allclose(output.get_lines()[0].get_ydata(), found.output_spectrum[keep, 0, 0].real)
    np.testing.assert_allclose(inputs.get_lines()[0].get_ydata(), found.input_spectrum[keep, 0, 0].real)
    assert len(output.collections) == 1
    assert (output.get_ylabel(), inputs.get_ylabel()) == ("output, density / (rad²/Hz)", "input, density")
    oe = sysid.oe(data, 1, 1, 1)
    (both,) = spectra([found, oe]).axes
    np.testing.assert_allclose(both.get_lines()[1].get_ydata(), 0.02 * oe.noise_variance[0, 0])
    assert len(spectra(sysid.spa(several)).axes) == 4
    assert len(spectra(sysid.spa(several), output="elbow").axes) == 1
    with pytest.raises(SysidError, match="cannot draw a StateSpace; expected FrequencyResponse, Estimate"):
        spectra(MODEL)  # type: ignore[arg-type]
    with pytest.raises(SysidError, match="gives no spectrum of the disturbance"):
        spectra(sysid.FrequencyResponse(np.ones(1), np.ones((1, 1, 1)), 0.02, "bare"))


def test_poles_of_estimates_have_their_regions(data: IOData) -> None:
    found = sysid.armax(data, 1, 1, 1)
    outline = sysid.models.poles_band(found).ellipses()[0]
    lines = pzmap(found).axes[0].get_lines()
    np.testing.assert_allclose(lines[-1].get_xdata(), outline.real)
    assert to_hex(lines[-1].get_color()) == PALETTE["armax"].colour
    assert len(pzmap(found, regions=False).axes[0].get_lines()) == len(lines) - 1


def test_a_length_and_a_thing_that_make_no_sense(data: IOData) -> None:
    refused("length must be above 0 s, got -1", lambda: step(MODEL, length=-1))
    with pytest.raises(SysidError, match="cannot draw a IOData; expected Estimate, StateSpace, ImpulseResponse"):
        impulse(data)  # type: ignore[arg-type]


def test_show_hands_the_figure_to_a_window(monkeypatch: pytest.MonkeyPatch) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    shown = []
    monkeypatch.setattr(pyplot, "show", lambda: shown.extend(pyplot.get_fignums()))
    before = len(pyplot.get_fignums())
    figure = step(MODEL)
    show(figure)
    assert len(shown) == before + 1
    assert figure.canvas.manager is not None
    pyplot.close("all")
