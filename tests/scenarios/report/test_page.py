"""Pages from templates: numbers of figures, lists of sections, minus signs."""

from markupsafe import Markup

from scenarios.report.page import Page, signed


def test_figures_are_numbered_and_sections_listed_as_they_are_rendered():
    page = Page()
    assert [page.number(name) for name in ("first", "second", "first")] == [1, 2, 1]
    page.part("Nothing in it")
    page.section(page.section("a", "First"), "b")
    assert page.contents == [("", []), ("Nothing in it", [("a", "First"), ("a", "b")])]


def test_numbers_have_true_minus_signs_but_for_code_and_drawings():
    assert signed("-13, (-1.5) to 5-10 Hz, siso-5, 1e-05") == "−13, (−1.5) to 5-10 Hz, siso-5, 1e-05"
    assert signed(-2.5) == "−2.5"
    assert signed(Markup("<svg>-3</svg>")) == "<svg>-3</svg>"
