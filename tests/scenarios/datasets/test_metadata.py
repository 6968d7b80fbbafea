"""Metadata of a data set: standard readers accept it, and it describes what is in the folder."""

import csv
import io
import json
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml

from hmtb_twin import Status
from hmtb_twin.files.hashes import file_hash
from hmtb_twin.files.netcdf import read_netcdf
from scenarios.datasets import metadata, open_data_set
from scenarios.datasets.index import read_index
from scenarios.datasets.metadata import ENVIRONMENT, METADATA, metadata_files
from scenarios.datasets.record_block import RecordBlock
from scenarios.datasets.spec import Twins, shipped
from scenarios.datasets.tables import read_table, table_text
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.multisines import Multisines
from scenarios.files.errors import ScenarioError


def read_croissant(path):
    read = pytest.importorskip("mlcroissant").Dataset(jsonld=str(path))
    assert not read.metadata.ctx.issues.errors | read.metadata.ctx.issues.warnings
    return list(read.records("experiments"))


def table(files):
    return list(csv.DictReader(io.StringIO(files["experiments.csv"].decode())))


def test_croissant_validates_and_its_records_are_those_of_the_index(tiny, tiny_spec, monkeypatch, copy):
    rows = read_croissant(tiny / "croissant.json")
    entries = read_index(tiny)["experiments"]
    assert [row["experiments/name"].decode() for row in rows] == [entry["name"] for entry in entries]
    assert [row["experiments/samples"] for row in rows] == [200, 200, 200]
    assert rows[0]["experiments/sha256"].decode() == file_hash(tiny / rows[0]["experiments/file"].decode())
    # Of many files those of one kind become a set.
    monkeypatch.setattr(metadata, "MOST_LISTED", 3)
    monkeypatch.setattr(metadata, "FEW", 1)
    for name, content in metadata_files(tiny, tiny_spec, read_index(tiny)).items():
        (copy / name).write_bytes(content)
    record = json.loads((copy / "croissant.json").read_text(encoding="utf-8"))
    sets = {one["@id"]: one["includes"] for one in record["distribution"] if one["@type"] == "cr:FileSet"}
    assert (sets["data-train-nc"], sets["truth-signals-nc"]) == ("data/train/*.nc", "truth/signals/*.nc")
    assert "data/train/binary-elbow_pitch.nc" not in {one["@id"] for one in record["distribution"]}
    assert len(read_croissant(copy / "croissant.json")) == 3


def test_the_citation_file_has_what_the_format_asks_for(tiny, tiny_spec):
    cited = yaml.safe_load((tiny / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited.keys() >= {"cff-version", "message", "title", "authors"}
    assert (cited["cff-version"], cited["type"], cited["license"]) == ("1.2.0", "dataset", "CC-BY-4.0")
    # Readers of the schema want texts where YAML would see a number or a day.
    assert (cited["version"], cited["date-released"]) == ("1", "2026-01-31")
    assert cited["identifiers"][0]["value"] == "sha256:" + open_data_set(tiny).records_hash
    named = replace(tiny_spec, creators=("Noether, Emmy", 'A "group": #1'), title="Süß: [1, 2] # no comment")
    again = yaml.safe_load(metadata_files(tiny, named, read_index(tiny))["CITATION.cff"])
    assert again["authors"] == [{"family-names": "Noether", "given-names": "Emmy"}, {"name": 'A "group": #1'}]
    assert again["title"] == named.title


def test_no_text_of_a_spec_becomes_html(tiny, tiny_spec):
    evil = "<script src=//x.example></script> & <b>R</b>"
    made = metadata_files(tiny, replace(tiny_spec, title=evil, description=evil, creators=(evil,)), read_index(tiny))
    page = made["README.md"].decode().partition("```bibtex")[0]
    assert "<script" not in page and "&lt;script src=//x.example&gt;&lt;/script&gt; &amp; " in page
    with pytest.raises(ScenarioError, match="expected one of http"):
        replace(tiny_spec, url="https://x.example><script>")


def test_the_same_folder_gives_the_bytes_of_the_build_with_the_whole_licence(tiny, tiny_spec):
    made = metadata_files(tiny, tiny_spec, read_index(tiny))
    assert {name: (tiny / name).read_bytes() for name in METADATA} == made
    text = (tiny / "LICENSE").read_text(encoding="utf-8")
    assert text.startswith("The data set tiny-v1, by The HMTB twin contributors, is licensed under\n")
    assert set(map(int, re.findall(r"^Section (\d) ", text, re.M))) >= set(range(1, 9))


def test_the_datasheet_answers_and_its_code_loads_a_record(tiny, monkeypatch):
    text = (tiny / "README.md").read_text(encoding="utf-8")
    for heading in ("Motivation", "Composition", "Channels", "Truth", "Collection", "Use", "Score", "Limitations"):
        assert f"\n## {heading}\n" in text
    for fact in ("| train | 2 | 400 |", "first **20 samples**", open_data_set(tiny).records_hash):
        assert fact in text
    (code,) = re.findall(r"```python\n(.*?)```", text, re.S)
    monkeypatch.chdir(tiny)
    loaded = {}
    exec(code, loaded)
    assert loaded["u"].shape == loaded["y"].shape == (200, 1)
    assert (loaded["dt"], loaded["window"]) == (0.02, 20)
    loaded["record"].close()


def test_an_experiment_without_a_record_is_listed_with_the_reason(tiny, tiny_spec):
    index = read_index(tiny)
    index["experiments"][0] |= {"failed": "the arm | was overloaded"}
    made = metadata_files(tiny, tiny_spec, index)
    rows = table(made)
    assert [row["status"] for row in rows] == ["the arm | was overloaded", "ok", "ok"]
    assert (rows[0]["samples"], rows[0]["sha256"]) == ("0", "-")
    assert "1 experiment has no record" in made["README.md"].decode()


def test_the_datasheet_of_a_public_data_set_says_what_is_withheld(tiny, tiny_spec):
    public = replace(tiny_spec, seed=0, withheld=True)
    text = metadata_files(tiny, public, read_index(tiny))["README.md"].decode()
    assert "**Is anything withheld?** Yes" in text and "Outputs of test records are withheld" in text
    assert "hmtb dataset build" not in text and "from the seed" not in text
    assert "withheld" not in (tiny / "README.md").read_text(encoding="utf-8")


def test_the_datasheet_says_how_much_was_limited_and_the_table_by_record(tiny, tiny_spec):
    rows = read_table(tiny / "experiments.csv")
    for row in rows:
        status = read_netcdf(tiny / row["file"]).variables["status"].values
        assert int(row["velocity_limited"]) == np.count_nonzero(status & Status.VELOCITY_LIMITED) > 0
        assert row["clipped"] == "0"
    train = [int(row["velocity_limited"]) for row in rows if row["part"] == "train"]
    text = (tiny / "README.md").read_text(encoding="utf-8")
    assert re.search(rf"^\| train \| 2 \| 400 \|.*\| {sum(train) / 4:.3g} \| identification \|$", text, re.M)
    assert "a converter stood at an end" not in text.split("## Channels")[0]
    # The excitation computer gives ten volts at most.
    loud = replace(tiny_spec.records[0], excitation=(Excitation("prbs", {"amplitude": 11.0}),))
    again = metadata_files(tiny, replace(tiny_spec, records=(loud, tiny_spec.records[1])), read_index(tiny))
    (clipped,) = {row["clipped"] for row in table(again)} - {"0"}
    assert 0 < int(clipped) <= 200
    assert "In 2 of the 2 records of `binary` a converter stood at an end of its range" in again["README.md"].decode()


def test_baselines_say_of_how_many_records_they_are(tiny, tiny_spec, copy):
    text = (tiny / "README.md").read_text(encoding="utf-8")
    assert "| arx | 2 2 1 | " in text
    assert all(row.endswith("| mrad | 1 of 1 |") for row in re.findall(r"^\| (?:hold|arx|truth) \|.*$", text, re.M))
    rows = read_table(copy / "baselines.csv")
    (copy / "baselines.csv").write_text(table_text(rows[0], [{**row, "twins": "0 4"} for row in rows]))
    fleet = metadata_files(copy, replace(tiny_spec, twins=Twins(1)), read_index(tiny))["README.md"].decode()
    assert "those of the twins 0, 4 of\n1." in fleet
    assert "1 randomised twin was drawn" in fleet


def test_a_page_on_the_web_is_cited_and_answers_questions(tiny, tiny_spec):
    placed = metadata_files(tiny, replace(tiny_spec, url="https://example.org/tiny"), read_index(tiny))
    text = placed["README.md"].decode()
    assert "version 1. https://example.org/tiny\n" in text
    assert "**Who answers questions?** The HMTB twin contributors, at <https://example.org/tiny>." in text
    assert json.loads(placed["croissant.json"])["url"] == "https://example.org/tiny"
    assert "The spec names no page" in (tiny / "README.md").read_text(encoding="utf-8")


WORDS = ENVIRONMENT.get_template("datasheet_block.md.j2").module
played, conditions = WORDS.played, WORDS.conditions
JOINTS = ("shoulder_yaw", "elbow_pitch")
PRBS = Excitation("prbs", {"amplitude": 0.5, "clock": 2}, repeat_frequency=0.1)


@pytest.mark.parametrize(
    ("one", "text"),
    [
        (PRBS, "pseudorandom binary sequence (amplitude 0.5 V, a level for 0.2 s, seed 0, {}, repeated every 10 s)"),
        (Excitation("prbs", {"clock": 1, "register": 20, "seed": 3}), "seed 3, register of 20 bits, {}, "),
        (
            Excitation("chirp", {"f_start": 1.0, "f_end": 5.0}, repeat_frequency=0.25, iterations=3),
            "chirp (f_start 0.5 Hz, f_end 2.5 Hz, amplitude 1 V, {}, repeated every 4 s, 3 times, then nothing)",
        ),
        (
            Excitation("bipolar_ramping_pulse", {"growing": True}, repeat_frequency=0.25),
            "(frequency 0.5 Hz, pulse width 0.2 s, amplitude 4 V, growing, {}, repeated every 4 s)",
        ),
        (Excitation("points", {"points": (0.5,) * 100}), "points of a file ({}, repeated every 2 s)"),
    ],
)
def test_an_excitation_is_described_as_it_is_played(one, text):
    assert text.format("100 points") in WORDS.excitation(one, drawn=False)


BLOCK = RecordBlock("b", "train", axes=JOINTS, each_axis=True, excitation=(PRBS,), duration=20.0, draw_waveforms=True)


def test_seeds_and_amplitudes_that_are_none_are_left_out():
    assert played(replace(BLOCK, amplitudes=(0.5, 2.0))) == (
        "pseudorandom binary sequence (a level for 0.2 s, 100 points, repeated every 10 s); at 0.5, 2 V; drawn anew "
        "for each experiment"
    )
    together = replace(BLOCK, each_axis=False)
    assert played(together).startswith("one waveform that all axes share: ")
    assert played(replace(together, excitation=(PRBS, PRBS))).startswith("a waveform of its own on each axis: ")
    assert "; elbow_pitch: white noise (" in played(replace(together, excitation=(PRBS, Excitation("white_noise"))))


def test_multisines_are_described_with_strength_settling_and_records():
    multisines = Multisines(rms=0.02, f_min=0.1, f_max=3.0, period=20.48, realisations=2, periods=3, settling=1)
    block = RecordBlock("m", "test", axes=JOINTS, multisines=multisines)
    assert played(block) == (
        "random-phase multisines of 0.02 rad root mean square, 0.1 to 3 Hz, lines 0.04883 Hz apart; 2 realisations x 2 "
        "records, with phases that are orthogonal over these, of 1 + 3 periods of 20.48 s, the first one to settle"
    )
    assert " x " not in played(replace(block, each_axis=True))
    assert played(replace(block, amplitudes=(0.01, 0.1))).endswith("; at 0.01, 0.1 rad root mean square")


def test_conditions_are_described_in_words():
    thesis, mimo = (shipped()[name].records for name in ("hmtb-thesis-v1", "hmtb-mimo-v1"))
    assert "several joints at once" in conditions(mimo[0])
    assert "payload that of the scenario" in conditions(thesis[0]) and "single_joint" not in conditions(thesis[0])
    block = replace(BLOCK, process_noises=(0.01,))
    assert conditions(block).endswith("process noise 0.01 of the rated torque; the stick commands one joint")
    without = replace(block.chain, resolver=False)
    assert conditions(replace(block, chain=without)).endswith("; without resolver")
