"""The lag window of spectral analyses of a joint."""

from collections.abc import Sequence

from sysid import IOData


def long_lag(data: IOData | Sequence[IOData]) -> int:
    """Lags that resolve a bandwidth near 1 Hz: a tenth of the samples; MATLAB's default, 30, does not.

    Args:
        data: One experiment, or several, the shortest of which has more lags.
    """
    lengths = [len(one.scored) for one in ((data,) if isinstance(data, IOData) else data)]
    return min(sum(lengths) // 10, min(lengths) - 1)
