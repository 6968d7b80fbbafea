import pytest

from scenarios import ScenarioError
from scenarios.whole_file import check_place, write_whole


def test_the_old_file_stays_until_the_new_one_is_whole(tmp_path):
    path = tmp_path / "report.html"
    write_whole(path, "first")
    with pytest.raises(UnicodeEncodeError):
        write_whole(path, "second \udc80")
    assert path.read_text() == "first"
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]


def test_a_folder_in_the_way_is_told_at_once(tmp_path):
    (tmp_path / "report.html").mkdir()
    with pytest.raises(ScenarioError, match="folder"):
        check_place(tmp_path / "report.html")
