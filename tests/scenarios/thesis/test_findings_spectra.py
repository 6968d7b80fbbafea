"""F5 and F6 are read over all frequencies, and where the input has power."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.thesis import findings_spectra as chapter
from scenarios.thesis.nonparametric import GRID
from scenarios.thesis.outcome import numbers
from sysid import FrequencyResponse


def test_what_the_window_leaks_does_not_count_where_the_input_has_power():
    line = (np.abs(GRID - 2.5) < 0.1).astype(float)
    leaked = 0.01 * (1.0 - line)
    densities = {
        "input_spectrum": line - 0.001 * (1.0 - line),
        "output_spectrum": 100.0 * line + leaked,
        "noise_spectrum": 0.001 * line + leaked,
    }
    response = FrequencyResponse(GRID.copy(), np.ones((len(GRID), 1, 1), dtype=complex), 0.02, "spa")
    verdict = replace(response, **{name: density[:, None, None] + 0j for name, density in densities.items()})
    kept = chapter._frequency_masks(verdict)
    assert kept[chapter.WHOLE].all()
    np.testing.assert_array_equal(kept[chapter.POWERED], line > 0)
    assert chapter._orders(verdict, kept[chapter.POWERED]) == pytest.approx(5.0)
    assert chapter._orders(verdict, kept[chapter.WHOLE]) < 3.0


def test_both_readings_are_told_with_their_numbers(study):
    for finding in (chapter.pulse_spectra, chapter.sinusoid_disturbance):
        decided = finding(study)
        assert set(numbers(decided)) == {
            f"{joint}, {way}" for joint in study.joints for way in ("all frequencies", "input's power")
        }
        assert np.isfinite(list(numbers(decided).values())).all()
        assert chapter.WHOLE in decided.why
        assert chapter.POWERED in decided.why
    orders = numbers(chapter.sinusoid_disturbance(study))
    for joint in study.joints:
        assert orders[f"{joint}, input's power"] > orders[f"{joint}, all frequencies"]
