"""The tables on chapters II and III have a row for every test."""


def test_every_test_has_a_row_with_every_joint(report):
    single, several = report["chapter_3"]["single"], report["chapter_3"]["several"]
    assert [row.name for row in single] == [str(n) for n in range(1, 9)]
    assert len(several) == 15
    assert all(len(row.cells) == 3 for row in (*single, *several))
    assert any(cell is not None for row in single for cell in row.cells)
