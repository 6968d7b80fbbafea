"""`hmtb waveform`: files, plots, and what they are good for."""

from pathlib import Path

import numpy as np
import pytest

from scenarios.experiments.waveform import read_points

WAVEFORMS = {
    "sine": "--frequency 1",
    "two_sines": "--frequency 1.25",
    "multisine": "--f-min 1 --f-max 5 --odd --seed 3",
    "prbs": "--clock 3 --seed 2 --register 12",
    "sign_recursion": "--memory 0.3 --as-printed --seed 2",
    "chirp": "--f-start 1 --f-end 5",
    "chirp_as_printed": "--f-low 1 --f-high 2 --f-center 3",
    "chirp_franklin": "--f-start 1 --f-end 5 --ramp 0.2 --offset 0.1",
    "bipolar_ramping_pulse": "--frequency 1 --pulse-width 0.1 --growing",
    "white_noise": "--seed 3",
}


@pytest.mark.slow
def test_every_waveform_has_flags_for_everything_it_takes(run, result, tmp_path):
    from inspect import signature

    from scenarios.experiments.excitation import COMPUTED

    assert set(WAVEFORMS) == set(COMPUTED)
    for kind, words in WAVEFORMS.items():
        typed = ["--amplitude", "0.5", *words.split()]
        output = result("waveform", kind, *typed, "--out", tmp_path)
        flags = {word[2:].replace("-", "_") for word in typed if word.startswith("--")}
        assert flags == set(signature(COMPUTED[kind]).parameters)
        assert set(output["parameters"]) == flags
        assert output["parameters"]["amplitude"] == 0.5
    out = run("waveform", "prbs", "--out", tmp_path, "--overwrite")[1]
    assert "mean / V" in out
    assert "update rate / Hz" in out


@pytest.mark.slow
def test_a_written_file_reads_back_to_the_last_bit(result, tmp_path):
    output = result("waveform", "chirp", "--f-start", "5", "--f-end", "10", "--out", tmp_path)
    again = result("waveform", "file", "--path", output["points"], "--out", tmp_path / "again")
    assert again["points"] == output["points"]
    assert Path(again["plot"]) == tmp_path / "again" / "chirp.png"
    assert Path(again["plot"]).read_bytes().startswith(b"\x89PNG")
    for key in ("order_of_excitation", "mean_v", "rms_v", "period_s"):
        assert again[key] == output[key]
    t = np.arange(100) / 50
    np.testing.assert_allclose(read_points(output["points"]), np.cos(2 * np.pi * (5 * t + 5 * t**2 / 4)), atol=1e-12)


@pytest.mark.slow
def test_a_file_of_few_digits_excites_no_more_than_its_tones(result, tmp_path):
    path = tmp_path / "mine.txt"
    np.savetxt(path, np.sin(2 * np.pi * 3 * np.arange(100) / 50), fmt="%.9g")
    assert result("waveform", "file", "--path", path, "--out", tmp_path)["order_of_excitation"] == 2


@pytest.mark.slow
def test_it_says_for_which_models_a_waveform_is_too_poor(run, result, tmp_path):
    output = result("waveform", "two_sines", "--frequency", "2.5", "--out", tmp_path)
    (warning,) = output["warnings"]
    assert output["needed_order"]["armax 5 3 3 2"] == 8
    assert output["needed_order"]["oe 2 2 1"] == output["needed_order"]["armax 2 2 2 1"] == 4
    assert output["needed_order"]["okid 2 5"] == 6
    assert warning == (
        "order of excitation 4 is too low for 5 of the 9 models of the study: oe (6 to 11), okid (6), armax (8)"
    )
    (warning,) = result("waveform", "sine", "--frequency", "5", "--out", tmp_path)["warnings"]
    assert warning == "order of excitation 2 is too low for every model of the study: they need 4 to 11"
    assert result("waveform", "prbs", "--out", tmp_path)["warnings"] == []
    out = run("waveform", "sine", "--frequency", "5", "--out", tmp_path, "--overwrite")[1]
    assert "warning: order of excitation 2 is too low" in " ".join(out.split())


@pytest.mark.thorough
def test_the_estimators_warn_by_the_same_rule():
    import warnings

    import sysid
    from scenarios.experiments.model_structures import needed_orders
    from scenarios.identification.methods import estimate

    t, rng = np.arange(2000), np.random.default_rng(1)
    for label, needed in needed_orders().items():
        method, *orders = label.split()
        for order, weak in ((needed - needed % 2 - 2 * (needed % 2 == 0), True), (needed + needed % 2, False)):
            # A sum of m sinusoids has order 2 m.
            u = sum(np.sin(2 * np.pi * (0.03 + 0.05 * k) * t + k**2) for k in range(order // 2))
            data = sysid.IOData(u, np.convolve(u, [0, 0, 0.5, 0.3])[: len(u)] + 0.1 * rng.standard_normal(2000), 0.02)
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                estimate(data, method, [int(value) for value in orders])
            messages = [str(entry.message) for entry in caught if "persistently exciting" in str(entry.message)]
            assert bool(messages) == weak, (label, order, messages)
            assert all(f"of order {order} only, the model needs {needed}" in text for text in messages)


def test_points_are_no_kind_of_their_own(complaint):
    assert "points" not in complaint("waveform", "square")


@pytest.mark.parametrize("word", ["nan", "inf", "two"])
def test_what_is_no_number_is_named_with_its_line(complaint, tmp_path, word):
    path = tmp_path / "mine.txt"
    path.write_text("1\n" * 41 + f"{word}\n" + "1\n" * 58, encoding="utf-8")
    message = complaint("waveform", "file", "--path", path, "--out", tmp_path)
    assert f"line 42: expected a finite number in V, given '{word}'" in message


@pytest.mark.slow
def test_points_beyond_the_converter_are_told(result, tmp_path):
    path = tmp_path / "high.txt"
    path.write_text("12\n-9\n" + "0.5\n" * 97 + "-11\n", encoding="utf-8")
    for words, count in (
        (("file", "--path", path), 2),
        (("prbs", "--amplitude", "11"), 100),
        (("prbs", "--amplitude", "9.9"), 0),
    ):
        warnings = result("waveform", *words, "--out", tmp_path / "out", "--overwrite")["warnings"]
        messages = [text for text in warnings if "±10 V of the excitation computer's converter" in text]
        assert [text.split()[0] for text in messages] == [str(count)] * bool(count)
