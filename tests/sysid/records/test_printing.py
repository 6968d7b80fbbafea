"""Numbers, tables and figures of printed results."""

import sys

import numpy as np
import pytest

import sysid
from sysid import IOData, Polynomials, StateSpace
from sysid.records.printing import Table, uncertain


@pytest.mark.parametrize(
    ("value", "deviation", "text"),
    [
        (1.23456, 0.0123, "1.235 ± 0.012"),
        (-1.5, 0.1, "-1.50 ± 0.10"),
        (1234.6, 23.0, "1235 ± 23"),
        (1.2e-9, 3.4e-11, "1.200e-09 ± 3.4e-11"),
        (0.0, 0.5, "0.00 ± 0.50"),
        (-3e-4, 0.21, "0.00 ± 0.21"),
        (1e12, 1e9, "1.0000e+12 ± 1.0e+09"),
        (2.0, 1e-15, "2.000000 ± 1.0e-15"),
        (2.0, np.nan, "2"),
        (np.nan, np.nan, "–"),
    ],
)
def test_values_end_where_their_uncertainty_does(value, deviation, text):
    assert uncertain([value], [deviation]) == [text]


def test_long_tables_are_shown_in_part_and_texts_escaped():
    table = Table([("<k>", [str(k) for k in range(100)]), ("", ["a & b"] * 100)])
    first, *rows, last = table.text().splitlines()
    assert (first, rows[0], rows[-1], last) == ("<k>", "0    a & b", "99   a & b", "(21 of 100 rows)")
    assert "<th>&lt;k&gt;</th>" in table.html()
    assert "a & b" not in table.html()


def test_models_print_their_equations_and_matrices():
    box_jenkins = Polynomials(B=[[0, 0.1], [0.3, 0]], F=[[1, -0.9], [1, 0]], D=[1, 0.5])
    assert str(box_jenkins).splitlines() == [
        "y(t) = B1(q)/F1(q) u1(t) + B2(q) u2(t) + 1/D(q) e(t)",
        "  B1(q) = 0.1 q^-1",
        "  B2(q) = 0.3",
        "  F1(q) = 1 - 0.9 q^-1",
        "  D(q) = 1 + 0.5 q^-1",
    ]
    assert str(Polynomials(A=[1, -0.9], B=[])) == "A(q) y(t) = e(t)\n  A(q) = 1 - 0.9 q^-1"
    model = StateSpace([[0.5]], [[0.25]], [[1]], [[0]], [[0.125]], 0.1, input_names=("valve",), output_names=("x",))
    rows = [line.split() for line in str(model).splitlines()]
    for row in (["B", "valve"], ["x1", "0.25"], ["C", "x1"], ["x", "1"], ["K", "x"], ["x1", "0.125"], ["D", "valve"]):
        assert row in rows
    assert "(10 of 30 columns)" in str(StateSpace(np.eye(30), np.eye(30), np.eye(30), np.eye(30), None, 0.1))


@pytest.mark.slow
def test_a_notebook_shows_tables_and_a_figure():
    rng = np.random.default_rng(0)
    data = IOData(rng.standard_normal(200), rng.standard_normal((200, 2)), 0.1, input_names=("<b> & 阀",))
    estimate = sysid.arx(data.select(outputs=[0]), 1, 1, 1)
    windows = "matplotlib.pyplot" in sys.modules and sys.modules["matplotlib.pyplot"].get_fignums()
    for result in (data, estimate, sysid.spa(IOData(None, data.y, 0.1))):
        html = result._repr_html_()
        assert html.count("data:image/png;base64,") == 1
        assert "<b>" not in html
    assert "<table>" in estimate._repr_html_()
    assert "<img" not in estimate.polynomials._repr_html_()
    assert ("matplotlib.pyplot" in sys.modules and sys.modules["matplotlib.pyplot"].get_fignums()) == windows


def test_a_printed_phase_lies_within_a_turn():
    late = np.exp(-2j * np.pi * np.array([1.0, 1.4, 1.8, 2.2]))
    response = sysid.FrequencyResponse.from_data([1.0, 2.0, 3.0, 4.0], late)
    printed = [float(line.split()[2]) for line in str(response).splitlines()[-4:]]
    np.testing.assert_allclose(printed, np.angle(late), atol=1e-4)
    np.testing.assert_allclose(response.phase[:, 0, 0], -0.8 * np.pi * np.arange(4), atol=1e-12)
