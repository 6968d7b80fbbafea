import pytest

from hmtb_twin import TwinError, load_arm
from hmtb_twin.parameters.provenance import markdown, provenance_table
from hmtb_twin.parameters.quantity import TAGS, quantity
from hmtb_twin.parameters.resources import model_file, models_directory

README = (models_directory() / "hmtb" / "README.md").read_text(encoding="utf-8").splitlines()


def test_readme_holds_every_number_with_unit_tag_and_source_and_no_other():
    assert all(line.tag in TAGS and line.unit and line.source for line in provenance_table())
    rows = [line for line in README if line.startswith("| ") and line.count("|") == 7]
    assert rows[1:] == [markdown(line) for line in provenance_table()]


def test_readme_holds_the_gains():
    rows = {line.split(" | ")[0]: line for line in README if line.count("|") == 4}
    for name, (kp, kd) in load_arm().gains.items():
        assert f"| {kp:.5g} | {kd:.5g} |" in rows[f"| {name.replace('_', ' ')}"]


def test_unknown_tag_is_refused():
    with pytest.raises(ValueError, match=r"'guessed'.*assumed"):
        quantity(1.0, "m", "guessed", "nowhere")


def test_an_unknown_model_lists_those_that_exist():
    with pytest.raises(TwinError, match=r"'hmtb/other\.xml'.*available: .*hmtb/hmtb\.xml"):
        model_file("hmtb/other.xml")
