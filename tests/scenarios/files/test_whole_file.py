import pytest
from matplotlib.figure import Figure

from scenarios import ScenarioError
from scenarios.files.atomic_write import check_place, write_whole
from scenarios.report.drawing import save_figure


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


@pytest.mark.parametrize(("name", "begins"), [("a.svg", b"<?xml"), ("a.png", b"\x89PNG"), ("a.PDF", b"%PDF")])
def test_figures_too_are_whole_or_as_they_were(tmp_path, name, begins):
    class Torn(Figure):
        def savefig(self, fname, **settings):
            super().savefig(fname, **settings)
            raise OSError("disk full")

    path = tmp_path / name
    save_figure(Figure((1, 1)), path)
    first = path.read_bytes()
    assert first.startswith(begins)
    with pytest.raises(OSError, match="disk full"):
        save_figure(Torn((2, 2)), path)
    assert path.read_bytes() == first
    assert [entry.name for entry in tmp_path.iterdir()] == [name]
