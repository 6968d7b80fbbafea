"""Pictures of the laboratory, and what is said where none can be drawn."""

import re
from dataclasses import replace

import numpy as np

from hmtb_twin import TwinError
from scenarios.experiments.campaign import RPCM
from scenarios.thesis.pictures import arm_picture, enlargement, exchange, film
from tests.scenarios.thesis.altered import with_log, without_log


def _no_opengl(*_, **__):
    raise TwinError("no OpenGL here, install libegl1")


def test_without_opengl_a_line_says_what_to_install(study, monkeypatch):
    monkeypatch.setattr("scenarios.thesis.pictures.render", _no_opengl)
    monkeypatch.setattr("scenarios.thesis.pictures.Stage", _no_opengl)
    assert arm_picture() == ("", "No OpenGL here, install libegl1")
    moments, outcome = exchange(study)
    assert moments == ()
    assert "inserted" in outcome


def test_moments_are_shown_in_the_order_of_the_exchange(study, monkeypatch):
    monkeypatch.setattr("scenarios.thesis.pictures.SIZE", (64, 48))
    monkeypatch.setattr("scenarios.thesis.pictures.PHASES", ("approach", "insert"))
    moments, _ = exchange(study)
    assert [entry.phase for entry in moments] == ["approach", "insert"]
    assert 0.0 < moments[0].time < moments[1].time
    assert len({entry.picture for entry in moments}) == 2  # each is a picture of its own


def test_without_the_record_there_is_nothing_to_show(study):
    assert exchange(without_log(study, RPCM)) == ((), "")


def test_a_film_enlarges_what_the_eye_would_miss_and_says_by_how_much(study, monkeypatch):
    monkeypatch.setattr("scenarios.thesis.pictures.SPAN", (20.0, 20.2))
    log = study.logs["siso-5-shoulder_pitch"]
    angles = np.asarray(log.true_angles)
    small = replace(log, true_angles=angles[0] + 0.01 * (angles - angles[0]))
    made = film(with_log(study, log.name, small))
    assert made.address.startswith("data:video/mp4;base64,AAAA")
    assert re.search(r"enlarged \d+ times: the joint moves by ±0\.\d+ mrad", made.caption)
    motions = {1e-3: 100, 2.5e-3: 20, 0.1: 1, 0.2: 1, 0.0: 1}
    assert {peak: enlargement(np.array([0.0, -peak])) for peak in motions} == motions


def test_without_record_graphics_or_encoder_the_page_says_why_there_is_no_film(study, monkeypatch):
    bare = film(without_log(study, "siso-5-shoulder_pitch"))
    assert bare.address == "" and "has no record" in bare.caption
    monkeypatch.setattr("scenarios.thesis.pictures.frames", _no_opengl)
    assert film(study).caption == "There is no film. No OpenGL here, install libegl1."
