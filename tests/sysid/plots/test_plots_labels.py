"""Labels of figures do not cover each other."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

import sysid
from sysid import plots
from sysid.plots.panels import apart
from tests.sysid.plots.figures import DATA, MODEL

NAMES = ("elbow_pitch measured", "shoulder_yaw measured")
LONG = replace(DATA, y=np.hstack((DATA.y, DATA.u)), output_names=NAMES, output_units=("rad", "rad"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("draw", "thing"),
    [
        (plots.record, [LONG, LONG]),
        (plots.spectra, sysid.spa(LONG)),
        (plots.correlations, sysid.covf(LONG)),
        (plots.recursion, sysid.rarx(DATA, 5, 5, 1)),
    ],
)
def test_no_label_covers_another(draw, thing):
    figure = draw(thing)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    texts = [text for a in figure.axes for text in (a.yaxis.label, *a.texts, *a.get_children()) if _shown(text)]
    assert len(texts) > 2
    for one, other in combinations(dict.fromkeys(texts), 2):
        assert not one.get_window_extent().overlaps(other.get_window_extent()), (one, other)


def _shown(artist):
    return hasattr(artist, "get_text") and artist.get_text()


def test_labels_move_only_as_far_as_they_must():
    np.testing.assert_allclose(apart(np.array([5.0, 0.0, 0.2]), 1.0), [5.0, -0.4, 0.6])


def test_the_phase_of_a_raw_periodogram_follows_the_model():
    drawn = plots.bode([sysid.etfe(DATA), MODEL]).axes[1].lines[0].get_ydata()
    response = sysid.etfe(DATA)
    expected = np.degrees(np.unwrap(np.angle(MODEL.frequency_response(response.frequencies)[:, 0, 0])))
    assert np.abs(drawn - expected).max() < 181.0
