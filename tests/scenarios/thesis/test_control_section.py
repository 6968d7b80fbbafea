"""The report's section on model reference control: every run and condition of the record is shown."""

from scenarios.control.campaign import CONTROLLED
from scenarios.control.design import METHODS
from scenarios.control.study import CONDITIONS, WRONG
from scenarios.report.page import Page
from scenarios.thesis.control_section import control_chart, control_section, read_control


def test_tables_and_chart_show_the_whole_record():
    record = read_control()
    assert {row["method"] for row in record["runs"]} == set(record["methods"]) <= set(METHODS)
    assert {"reach", "rpcm"} <= {row["scenario"] for row in record["runs"]}
    assert {row["condition"] for row in record["stress"]} == {"", *CONDITIONS, *WRONG}
    page = Page().render("control.html.j2", {"control": control_section(None), "figures": {}})
    assert page.count("<tr>") == 2 + len(record["runs"]) + 1 + len(CONDITIONS) + len(WRONG)
    first = record["runs"][0]
    assert f"{1e3 * first['rmse_with']:.3g}" in page
    assert first["factor"] == first["rmse_without"] / first["rmse_with"]
    assert f"{first['factor']:.2g} ({first['factor_arm']:.2g})" in page
    views = control_chart().views
    assert [key for (key,) in views] == list(dict.fromkeys(row["scenario"] for row in record["runs"]))
    for (panel,) in views.values():
        assert [len(one.y) for one in panel.series] == [len(CONTROLLED)] * (1 + len(record["methods"]))
