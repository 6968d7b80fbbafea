import numpy as np
import pytest

from hmtb_twin.parameters.drives import COLDEST, HOTTEST, kinematic_viscosity, relative_viscosity


def test_the_grade_and_its_hot_viscosity_are_met():
    assert kinematic_viscosity(40.0) == pytest.approx(32.0, rel=1e-12)
    assert kinematic_viscosity(100.0) == pytest.approx(5.4, rel=1e-12)
    assert relative_viscosity(40.0) == pytest.approx(1.0, rel=1e-12)


def test_walther_plot_is_a_straight_line():
    temperatures = np.linspace(COLDEST, HOTTEST, 21)
    x = np.log10(temperatures + 273.15)
    y = np.log10(np.log10([kinematic_viscosity(t) + 0.7 for t in temperatures]))
    line = np.polyval(np.polyfit(x, y, 1), x)
    np.testing.assert_allclose(y, line, atol=1e-12)
    assert (np.diff(y) < 0.0).all()
