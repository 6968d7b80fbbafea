import numpy as np
import pytest

from sysid import read_csv, read_experiments
from tests.refusals import refused

N, EPOCH = 40, 1_767_225_600
U, Y = np.random.default_rng(0).standard_normal((2, N))


def write(path, name, times, *, separator=","):
    rows = (f"{time}{separator}{u}{separator}{y}" for time, u, y in zip(times, U, Y, strict=True))
    path.write_text("\n".join((separator.join((name, "u", "y")), *rows)))
    return path


@pytest.mark.parametrize(
    ("name", "times", "options", "remark"),
    [
        ("stamp", [EPOCH * 10**9 + 20_000_000 * k for k in range(N)], {}, "for ns since 1970, by their size"),
        ("Timestamp", [EPOCH * 1000 + 20 * k for k in range(N)], {}, "for ms since 1970, by their size"),
        ("field.header.stamp", [EPOCH * 10**6 + 20_000 * k for k in range(N)], {"time_unit": "us"}, ""),
        ("clk", [0.02 * k for k in range(N)], {"time": "clk"}, ""),
        ("Zeit [ms]", [20 * k for k in range(N)], {"dt": 0.02}, ""),
        ("Uhr", [20 * k for k in range(N)], {"dt": 0.02}, "times are column 'Uhr', in ms: it increases by the stated"),
        ("ramp", [0.3 * k for k in range(N)], {"dt": 0.02}, "ramp increases as steadily as times and is not used"),
        (
            "Time (ms)",
            ["01.02.2026 12:00:00.000"] * N,
            {"dt": 0.02},
            "not read as a time, so that gaps are not",
        ),
        ("clk", [0.02 * k for k in range(N)], {}, "times are column 'clk', the only one that increases steadily"),
        ("elapsed_min", [0.02 * k / 60 for k in range(N)], {}, ""),
        ("date", [f"2026-01-31T12:00:{0.02 * k:05.2f}Z" for k in range(N)], {}, ""),
        ("when", [f"2026-01-31 12:00:{0.02 * k:05.2f}" for k in range(N)], {"time": "when"}, ""),
        ("utc", [f"23:00:{0.02 * k:05.2f}" for k in range(N)], {}, ""),
    ],
)
def test_times_of_any_name_and_unit(tmp_path, recwarn, name, times, options, remark):
    data = read_csv(write(tmp_path / "log.csv", name, times), **options)
    assert data.dt == 0.02
    np.testing.assert_array_equal(data.u[:, 0], U)
    assert len(recwarn) == bool(remark)
    assert all(remark in str(one.message) and "log.csv: " in str(one.message) for one in recwarn)


@pytest.mark.parametrize(
    ("name", "times", "options", "message"),
    [
        ("t", [*range(N - 1), 3], {}, r"line 41: time 3 in column 't' is not after 38 in line 40 \(1 such steps\)"),
        ("t", [*range(N - 1), ""], {}, "log.csv, line 41: no time in column 't'"),
        ("clk", range(0, 2 * N, 2), {"time": "clock"}, "no column of times 'clock'; there are clk, u, y"),
        ("clk", range(N), {"time": "clk", "time_unit": "weeks"}, "in 'weeks'; expected s, ms, us, ns, min or h"),
        ("clk", range(N), {}, "no sampling interval; .*; the file has clk"),
        ("Zeit [ms]", range(0, 20 * N, 20), {"dt": 0.01}, "interval 0.01 s by dt as given, 0.02 s by 'Zeit .ms.'"),
        ("Time (ms)", ["01.02.2026 12:00:00.000"] * N, {}, "'Time .ms.' holds '01.02.2026 12:.*: write numbers, as ms"),
        ("Time", ["ms", *range(N - 1)], {}, "line 2: could not convert 'ms' .*; delete a row of units"),
        ("mode", ["on"] * N, {"time": "mode"}, "could not convert 'on' in column 'mode'"),
        ("date", ["2026-01-31T12:00:00", *["never"] * (N - 1)], {}, "line 3: could not convert 'never' .* times"),
    ],
)
def test_wrong_times(tmp_path, name, times, options, message):
    refused(message, read_csv, write(tmp_path / "log.csv", name, times), **options)


def test_one_of_several_clocks_is_not_chosen(tmp_path):
    path = write(tmp_path / "log.csv", "a,b", [f"{3 * k},{4 * k}" for k in range(N)])
    refused("several columns may be times: a, b; expected one, named by time=NAME", read_csv, path)
    assert read_csv(path, time="b").dt == 4.0


@pytest.mark.parametrize("name", ["Zeit [ms]", "Uhr"])
def test_a_stated_interval_does_not_hide_a_gap(tmp_path, name):
    path = write(tmp_path / "log.csv", name, 20 * np.delete(np.arange(N + 5), np.arange(20, 25)))
    with pytest.warns(match=r"cut there into 2 experiment\(s\)"):
        assert [len(part) for part in read_experiments(path, dt=0.02)] == [20, 20]


def test_files_are_experiments_of_one_interval(tmp_path):
    intervals = (0.02, 0.02 * (1 + 3e-4), 0.03)
    paths = [write(tmp_path / f"{k}.csv", "t", dt * np.arange(N)) for k, dt in enumerate(intervals)]
    parts = read_experiments(paths[:2])
    assert [(part.name, part.dt) for part in parts] == [("0", 0.02), ("1", 0.02)]
    refused("2 is sampled every 0.03 s, 0 every 0.02 s; expected one interval", read_experiments, paths)
    refused("expected the paths of data files, got none", read_experiments, [])


def test_a_log_with_gaps_is_cut_by_read_experiments_alone(tmp_path):
    times = 0.02 * np.delete(np.arange(N + 5), np.arange(20, 25))
    path = write(tmp_path / "log.csv", "t", times)
    refused("1 gap.* the longest of 0.12 s after 0.38 s; expected none", read_csv, path)
    with pytest.warns(match=r"cut there into 2 experiment\(s\)"):
        assert [len(part) for part in read_experiments(path)] == [20, 20]
    path.write_text(path.read_text().replace(f",{Y[3]}", ","))
    with pytest.warns(match=r"cut there into 2 experiment\(s\)"):
        parts = read_experiments(path, missing=True)
    assert [np.flatnonzero(~part.known).tolist() for part in parts] == [[3], []]
    np.testing.assert_array_equal(np.vstack([part.u for part in parts])[:, 0], U)
    refused("1 gap.* expected none", read_csv, path, missing=True)
