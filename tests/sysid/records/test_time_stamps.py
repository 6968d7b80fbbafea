import warnings
from datetime import datetime, timedelta

import numpy as np
import pytest

from sysid import SysidWarning, read_csv, read_experiments
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
        ("Time (ms)", ["59:45.0"] * N, {"dt": 0.02}, "not read as a time, so that gaps are not"),
        ("Time", range(N), {"dt": 0.02}, "column 'Time' counts samples; each is the stated 0.02 s"),
        ("sample", [7 + k for k in range(N)], {"dt": 0.02, "time": "sample"}, "'sample' counts samples; each is"),
        ("clock", [(86399.9 + 0.02 * k) % 86400 for k in range(N)], {}, "passes midnight or noon 1 time(s)"),
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
        ("clk", range(N), {"time": "clk", "time_unit": "weeks"}, "in 'weeks'; expected s, ms, us, ns, min, h or days"),
        ("clk", range(N), {}, "no sampling interval; .*; the file has clk"),
        ("Zeit [ms]", range(0, 20 * N, 20), {"dt": 0.01}, "interval 0.01 s by dt as given, 0.02 s by 'Zeit .ms.'"),
        ("Time (ms)", ["59:45.0"] * N, {}, "'Time .ms.' holds '59:45.0.*: write numbers, as ms"),
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


def clock_texts(form, start="2021-01-01T00:00:00", step=60, n=N):
    """Times as texts; of `form` the days and months have no leading zeros."""
    for k in range(n):
        time = datetime.fromisoformat(start) + timedelta(seconds=step * k)
        yield form.format(time, d=time.day, m=time.month, h=time.hour, half=time.hour % 12 or 12)


@pytest.mark.parametrize(
    ("form", "start"),
    [
        ("{d}/{m}/{0:%Y} {h}:{0:%M}", "2021-01-01T23:50"),
        ("{m}/{d}/{0:%Y} {h}:{0:%M}", "2021-01-01T23:50"),
        ("{m}/{d}/{0:%y} {h}:{0:%M}", "2021-02-28T23:50"),
        ("{d}/{m}/{0:%Y} {h}:{0:%M}", "2021-05-05T12:00"),
        ("{m}/{d}/{0:%Y} {half}:{0:%M:%S} {0:%p}", "2021-03-31T23:50"),
        ("{0:%d.%m.%Y %H:%M:%S}", "2021-02-01T23:50"),
        ("{0:%d.%m.%Y %H:%M:%S.%f}", "2021-02-01T23:50"),
        ("{0:%Y/%m/%d %H:%M}", "2021-02-01T23:50"),
        ("{0:%d-%b-%Y %H:%M:%S}", "2021-02-01T23:50"),
        ("{0:%d.%m.%Y,%H:%M:%S}", "2021-02-01T23:50"),
        ("{half}:{0:%M:%S} {0:%p}", "2021-02-01T23:50"),
        ("{0:%H:%M:%S}", "2021-02-01T23:50"),
        ("{half}:{0:%M:%S}", "2021-02-01T11:50"),
    ],
)
def test_dates_are_read_where_the_sequence_tells_day_from_month(tmp_path, form, start):
    name = "Date,Time" if "," in form else "Time"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        data = read_csv(write(tmp_path / "log.csv", name, clock_texts(form, start)))
    assert (data.dt, len(data)) == (60.0, N)
    assert all("rise" in str(one.message) or "passes midnight" in str(one.message) for one in caught)


def test_dates_that_may_be_two_are_refused(tmp_path):
    # A night between two evenings: on 1 and 2 April, or in January and February.
    texts = [f"1/4/2021 12:{k:02d}" for k in range(20)] + [f"2/4/2021 12:{k:02d}" for k in range(20)]
    message = "'1/4/2021 12:00' may be day/month/year or month/day/year, and the sequence does not tell which"
    refused(message, read_experiments, write(tmp_path / "log.csv", "Time", texts))
    texts[3] = "31/4/2021 12:03"
    refused("line 5: could not convert '31/4/2021 12:03'", read_csv, write(tmp_path / "log.csv", "Time", texts))


def test_a_clock_that_passes_midnight_within_a_gap_needs_a_date(tmp_path):
    texts = [*clock_texts("{0:%H:%M:%S}", "2021-01-01T23:00", n=20), *clock_texts("{0:%H:%M:%S}", n=20)]
    message = "time 00:00:00.000 in column 'Time' is not after 23:19:00.000 .* midnight within a gap needs a date"
    refused(message, read_csv, write(tmp_path / "log.csv", "Time", texts))


def test_a_counter_needs_an_interval(tmp_path):
    path = write(tmp_path / "log.csv", "sample", range(N))
    refused(
        "column 'sample' counts samples, 0, 1, 2, ...; expected their interval, dt in s", read_csv, path, time="sample"
    )
    refused("no sampling interval.*; sample counts samples, of which dt is the interval", read_csv, path)
    with pytest.warns(UserWarning, match="counts 0, 1, 2, ... and is taken for seconds"):
        assert read_csv(write(path, "Time", range(N))).dt == 1.0
    # A lost sample shows in the counter.
    lossy = write(path, "Time", [k + (k > 9) for k in range(N)])
    with pytest.warns(UserWarning, match="counts samples"):
        assert len(read_csv(lossy, dt=0.02)) == N + 1


def test_rows_without_input_are_lost_rows(tmp_path):
    path = tmp_path / "log.csv"
    rows = [f"{0.02 * k:.2f},{U[k % N]},{Y[k % N]}" for k in range(400)]
    rows[200] = "4.00,,"
    path.write_text("\n".join(["t,u,y", *rows]))
    refused(
        "line 202: 1 of 400 samples of input 'u' are empty or NaN; expected all inputs; missing=True", read_csv, path
    )
    with pytest.warns(UserWarning, match="1 rows without input count as lost; 1 row.s. lost between stamps, of which"):
        parts = read_experiments(path, missing=True)
    assert [len(part) for part in parts] == [200, 199]
    with pytest.warns(UserWarning, match="1 of 400 samples are missing"):
        assert int((~read_csv(path, missing=True).known).sum()) == 1
    rows = [row if k % 5 == 0 else f"{row.split(',')[0]},,{Y[k % N]}" for k, row in enumerate(rows)]
    path.write_text("\n".join(["t,u,y", *rows]))
    refused("expected 5% at most. An input that is logged only when it changes", read_csv, path, missing=True)


def test_a_clock_may_be_named_by_its_unit(tmp_path):
    path = tmp_path / "board.csv"
    path.write_text("millis,u,y\n" + "".join(f"{20 * k},{k % 3},{k % 5}\n" for k in range(N)))
    assert read_csv(path).dt == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("step", "decimals"), [(60.0, 9), (0.5, 9), (3600.0, 9), (60.0, 5), (1.0, 6), (0.1, 8), (30.0, 10)]
)
def test_days_of_a_spreadsheet_are_taken_for_days_and_said(tmp_path, step, decimals):
    path = tmp_path / "sheet.csv"
    lines = [f"{44197 + k * step / 86400:.{decimals}f},{k % 3},{k % 5}\n" for k in range(20 * N)]
    path.write_text("Time,u,y\n" + "".join(lines))
    with pytest.warns(SysidWarning, match="taken for days since 1900, as spreadsheets have them"):
        record = read_csv(path)
    assert record.dt == pytest.approx(step, rel=1e-3)


@pytest.mark.parametrize("step", [0.02, 0.001, 0.5, 0.0025, 0.0001])
def test_seconds_of_that_size_stay_seconds(tmp_path, step):
    path = tmp_path / "uptime.csv"
    path.write_text("Time,u,y\n" + "".join(f"{44197 + k * step:.6f},{k % 3},{k % 5}\n" for k in range(N)))
    assert read_csv(path).dt == pytest.approx(step)
