"""What `hmtb verify` says in words: bandwidths with the answer, why figures fail, how far a run is."""

import math
from dataclasses import replace

import pytest

from scenarios.bench.bandwidth import bandwidth_classes, one_hertz_answer
from scenarios.bench.metric import Metric, Part
from scenarios.bench.result import Result
from scenarios.bench.result_tables import bandwidth_table
from scenarios.commands.verify_output import show, show_reasons
from scenarios.estimators.estimator import Estimator, Limits

NAN = float("nan")
INFINITE = (-math.inf, math.inf)
ROWS = (("elbow_pitch", 40.0, 1.02, 1.04, 8), ("elbow_pitch", 5.0, 0.9, 0.6, 5), ("shoulder_yaw", 5.0, NAN, NAN, 0))


def bandwidth() -> Metric:
    parts = [Part(f"{row[0]} multisine {row[1]:g} mrad", row[2], row[3], (0.8, 1.1), INFINITE, None) for row in ROWS]
    shared = {"excitation": "multisine", "variant": "nominal", "small_signal": 1.1, "models": 8, "published": {}}
    shared |= {"best_linear_ci95": (0.9, 1.1)}
    classes = []
    for (joint, mrad, median, best, near), part in zip(ROWS, parts, strict=True):
        hz = () if math.isnan(median) else (0.8, median, 1.1)
        known = {"label": part.label, "joint": joint, "mrad": mrad, "hz": hz, "best_linear": best, "near": near}
        classes.append({**known, **shared})
    numbers = 0.9, 0.6, (0.8, 1.1), None, 0.0, ""
    return Metric("bandwidth", "Recovered bandwidth", "Hz", *numbers, tuple(parts), {"classes": classes})


def test_bandwidths_joint_by_joint_and_the_answer():
    rows = bandwidth_classes({"bandwidth": bandwidth()})
    assert [(row.joint, row.mrad, row.near) for row in rows] == [
        ("elbow_pitch", 5.0, 5),
        ("elbow_pitch", 40.0, 8),
        ("shoulder_yaw", 5.0, 0),
    ]
    (first, *_) = bandwidth_table(rows).rows
    assert first[4] == "0.8 to 1.1" and first[-1] == "5 of 8"
    text = one_hertz_answer(rows)
    assert "in 13 of 24 records and in the median of 2 of 3 rows" in text
    assert text.endswith("truth is about 1 Hz in 1 rows, and the median lies within 10 % of that truth in 1.")
    assert one_hertz_answer(rows[2:]).endswith(
        "about 1 Hz in 0 rows, and the median lies within 10 % of that truth in 0."
    )
    assert bandwidth_classes({}) == ()
    assert bandwidth_classes({"bandwidth": replace(bandwidth(), parts=(), curves={})}) == ()


def figure(name: str, *parts: Part, passed: bool | None) -> Metric:
    return Metric(name, f"{name.title()}: of something", "", 1.0, 1.0, (0.0, 2.0), passed, 1e-4, "what; more", parts)


def test_a_block_for_each_figure_that_does_not_pass(capsys):
    failed = [Part(f"p{k}", 10.0 * k, 1.0, (0.0, 2.0), (-math.inf, 2.0), False) for k in range(1, 8)]
    expected = Part("p8", 3.0, 1.0, (0.0, 2.0), (5.0, math.inf), False, theory=False, why="it is biased")
    figures = [
        figure("first", Part("p0", 1.0, 1.0, (0.0, 2.0), (0.5, 2.0), True), passed=True),
        figure("second", *failed, expected, passed=False),
        figure("third", expected, passed=True),
        figure("fourth", replace(expected, limits=(0.5, 2.0)), passed=True),
        replace(figure("fifth", passed=None), why="what; too few records"),
        bandwidth(),
    ]
    show_reasons(figures, verbose=False)
    assert capsys.readouterr().out.splitlines() == [
        "✗ Second: of something: fails",
        "    what",
        *(f"    p{k}  {10 * k:>7}  limits: at most 2" for k in range(7, 2, -1)),
        "    and 2 more: --verbose has them",
        "△ Third: of something: fails as theory says",
        "    it is biased",
        "    p8        3  limits: at least 5",
        "△ Fourth: of something: fails as theory says",
        "    for reasons given above",
        "    p8        3  limits: 0.5 to 2",
        "– Fifth: of something: no verdict",
        "    too few records",
        "",
    ]
    show_reasons(figures, verbose=True)
    out = capsys.readouterr().out
    assert "✓ First: of something: passes\n    what; more\n" in out
    assert "    p1       10  limits: at most 2\n    p8        3  limits: at least 5 △\n" in out


def test_a_part_that_fails_without_a_limit_says_why(capsys):
    some = Part("p1", 1.0, 1.0, (0.0, 2.0), INFINITE, False, why="claimed of 3 of 20 records")
    none = Part("p2", 1.0, 0.0, (0.0, 2.0), (0.0, 0.0), False)
    show_reasons([figure("first", some, none, passed=False)], verbose=False)
    lines = capsys.readouterr().out.splitlines()
    assert "    p1        1  claimed of 3 of 20 records" in lines and "    p2        1  limits: 0" in lines


def test_the_table_shows_what_passes_and_no_interval_of_a_single_point(tmp_path, capsys):
    exact = Part("p1", 14.7, 6.0, (14.7, 14.7), (6.0, math.inf), True)
    near, far = (Part(name, value, 1.0, (0.9, 1.2), (-math.inf, 1.4), True) for name, value in (("a", 1.0), ("b", 1.1)))
    figures = {
        "digits": Metric("digits", "Digits", "", 14.7, 6.0, (14.7, 14.7), True, 0.0, "", (exact,)),
        "efficiency": Metric("efficiency", "Efficiency", "", 1.1, 1.0, (0.9, 1.2), True, 0.0, "", (near, far)),
        "bandwidth": bandwidth(),
    }
    show([Result(Estimator("mine", "a:b"), Limits(), "quick", 0, "", "", {}, "", {}, {}, 0.5, figures)], tmp_path)
    lines = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert "value passes if 95 % interval verdict" in lines
    assert "Digits 14.7 at least 6 – ✓ passes" in lines
    assert "Efficiency 1.1 at most 1.4 0.9 to 1.2 ✓ passes" in lines
    assert "Recovered bandwidth, Hz 0.9 – 0.8 to 1.1 – no verdict" in lines


@pytest.mark.parametrize(
    ("kinds", "kept", "more"),
    [
        (5, 5, ""),
        (6, 6, "  1 x for other reasons: the result file has the most frequent ones"),
        (9, 9, "  10 x for other reasons: the result file has the most frequent ones"),
        (30, 20, "  325 x for other reasons: the result file has the most frequent ones"),
    ],
)
def test_reasons_that_are_not_printed_are_counted(kinds, kept, more, tmp_path, capsys):
    """All failures are accounted for, also where the file has not all of their reasons."""
    counts = {f"error: {k}": kinds - k for k in range(kinds)}
    outcomes = {"model": 5, "refused": 3, "error": sum(counts.values())}
    reasons = dict(list(counts.items())[:kept])
    effort = "quick, at most 20 records of a problem"
    show([Result(Estimator("mine", "a:b"), Limits(), effort, 0, "", "", {}, "", outcomes, reasons, 0.5, {})], tmp_path)
    out = capsys.readouterr().out
    lines = out.splitlines()
    assert " ".join(out.split()).startswith("mine: quick bench, at most 20 records of a problem, seed 0 ")
    assert f"  {kinds - 4} x error: 4" in lines and not any("error: 5" in line for line in lines)
    assert [line for line in lines if "for other reasons" in line] == [more] * bool(more)


@pytest.mark.parametrize(
    ("method", "number", "words"),
    [
        ("observer", 2, "fails no figure that it should pass; 2 figures fail as theory says of observer"),
        ("pem", 1, "fails no figure that it should pass; 1 figure fails as theory says of pem"),
        ("subspace", 0, "fails no figure that it should pass"),
    ],
)
def test_the_last_line_counts_what_theory_excuses(method, number, words, tmp_path, capsys):
    fine = Part("p1", 1.0, 1.0, (0.9, 1.1), (0.5, 1.5), True)
    figures = {}
    for place in range(3):
        bad = [Part("p2", 9.0, 1.0, (8.0, 9.9), (0.5, 1.5), False, theory=False, why="so it is")] * (place < number)
        figures[f"f{place}"] = Metric(f"f{place}", "One", "", 1.0, 1.0, (0.9, 1.1), True, 0.0, "", (fine, *bad))
    one = Estimator("mine", "a:b", method=method)
    show([Result(one, Limits(), "quick", 0, "", "", {}, "", {"model": 1}, {}, 0.5, figures)], tmp_path)
    assert capsys.readouterr().out.splitlines()[-1] == f"mine: {words}"
