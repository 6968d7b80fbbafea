"""Pictures of the laboratory, and what is said where none can be drawn."""

from hmtb_twin import TwinError
from scenarios.experiments.campaign import RPCM
from scenarios.thesis.figures_overview import arm_picture, exchange
from tests.scenarios.thesis.altered import without_log


def _no_opengl(*_, **__):
    raise TwinError("no OpenGL here, install libegl1")


def test_without_opengl_a_line_says_what_to_install(study, monkeypatch):
    monkeypatch.setattr("scenarios.thesis.figures_overview.render", _no_opengl)
    monkeypatch.setattr("scenarios.thesis.figures_overview.Stage", _no_opengl)
    assert arm_picture() == ("", "No OpenGL here, install libegl1")
    moments, outcome = exchange(study)
    assert moments == ()
    assert "inserted" in outcome


def test_moments_are_shown_in_the_order_of_the_exchange(study, monkeypatch):
    monkeypatch.setattr("scenarios.thesis.figures_overview.SIZE", (64, 48))
    moments, _ = exchange(study, ("approach", "insert"))
    assert [entry.phase for entry in moments] == ["approach", "insert"]
    assert 0.0 < moments[0].time < moments[1].time
    assert len({entry.picture for entry in moments}) == 2  # each is a picture of its own


def test_without_the_record_there_is_nothing_to_show(study):
    assert exchange(without_log(study, RPCM)) == ((), "")
