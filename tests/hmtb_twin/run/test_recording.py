import numpy as np
import pytest

from hmtb_twin.run.batch_run import BLOCK, Recording


@pytest.mark.parametrize("lengths", [(3,), (BLOCK,), (BLOCK + 1, 5, 3 * BLOCK), (2 * BLOCK - 1, 2 * BLOCK)])
def test_every_experiment_is_given_what_was_written_in_its_time(lengths):
    rng, ticks = np.random.default_rng(1), max(lengths)
    channels = {"angle": rng.standard_normal((ticks, len(lengths), 7)), "force": rng.random((ticks, len(lengths), 1))}
    recording = Recording(lengths, {"angle": 7, "force": 1})
    for tick in range(ticks):
        recording.write(tick, {name: values[tick] for name, values in channels.items()})
    recording.close(ticks)
    for row, (record, length) in enumerate(zip(recording.records, lengths, strict=True)):
        for name, values in channels.items():
            np.testing.assert_array_equal(record[name], values[:length, row], strict=True)


def test_a_record_keeps_no_more_than_its_own():
    records = Recording((4, 1000), {"angle": 7}).records
    assert [record["angle"].base is None for record in records] == [True, True]
    assert [record["angle"].shape for record in records] == [(4, 7), (1000, 7)]
