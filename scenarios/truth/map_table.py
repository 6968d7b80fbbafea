"""Table of the maps: the dynamics of the arm, joint by joint, at many operating points."""

import csv
import io
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from hmtb_twin import JOINTS, Arm, OverloadError, Truth, linearize
from hmtb_twin.parameters.variants import INDEXED_JOINTS
from sysid.records.arrays import Locked

MOVING = tuple(name for name in JOINTS if name not in INDEXED_JOINTS)
"""Joints that follow a command on every arm; a pin may hold the others."""

COLUMNS = np.array([JOINTS.index(name) for name in MOVING])
"""Their columns among the seven joints."""

CROSS_BAND = 5.0
"""Upper end of the band in which cross gains are searched, Hz: that of the experiments' excitation."""

MODE_SHARE = 0.05
"""A pole counts for a joint's damping where its mode carries more than this part of the gain at 0 Hz."""

FAST = 62.8
"""Poles faster than 10 Hz, in rad/s, do not count for a joint's damping."""

REFINEMENTS = 40
"""Most steps of the search for a bandwidth."""

UNITS = {
    "near": "deg",
    "anywhere": "deg",
    "supply pressure": "MPa",
    "oil temperature": "°C",
    "amplitude": "rad rms",
    "friction": "times the arm's",
    **dict.fromkeys(MOVING, "deg"),
}
"""Units of the values that vary; names and poses have none."""

M = len(MOVING)
SHAPES: dict[str, tuple[int, ...]] = {
    "bandwidth": (M,),
    "gain": (M,),
    "damping": (M,),
    "cross": (M, M),
    "relative_gain": (M,),
    "interval": (M, 2),
    "stick_bandwidth": (M,),
    "distortion": (M,),
    "slewing": (M,),
}
"""Shape of each quantity at one operating point."""


@dataclass(frozen=True, eq=False)
class MapTable(Locked):
    """Dynamics at n operating points; the m columns are the joints of `MOVING`; NaN where a value does not exist.

    Small-signal rows come from linear models: all of them is NaN where the drives cannot hold the arm. Rows that vary
    amplitude or friction come from best linear approximations of the studied joints, each excited alone.

    Attributes:
        varied: What varies (n,): `operating pose`, `workspace`, a joint, `near`, `anywhere`, `payload`,
            `supply pressure`, `oil temperature`, `amplitude` or `friction`.
        value: Its value (n,), a number in the unit of `UNITS` or a name; of random poses the largest turn of a joint
            from the operating pose.
        angles: Operating points (n, 7), rad.
        stable: Whether the drives hold the arm and all poles lie inside the unit circle (n,).
        bandwidth: First frequency at which a joint's gain is 3.01 dB below that at 0 Hz (n, m), Hz.
        gain: Gain at 0 Hz (n, m); of best linear approximations the gain at low frequency over that of the truth.
        damping: Smallest damping ratio among the poles below 10 Hz that count for a joint (n, m): 1 where all are real.
        cross: Largest gain up to 5 Hz from another joint's command (last axis) to a joint's angle, over that joint's
            own gain at 0 Hz (n, m, m); 0 on the diagonal.
        relative_gain: Diagonal of the relative gain array at a joint's own bandwidth (n, m), complex: its response to
            its command over the same with the other joints' angles kept still; 1 without coupling [Bristol1966].
        interval: 95 % interval of the bandwidth of a best linear approximation (n, m, 2), Hz.
        stick_bandwidth: Its bandwidth from the angle asked for at the stick, before the velocity limit (n, m), Hz.
        distortion: Its nonlinear distortion, percent of the linear part (n, m).
        slewing: Its share of the time at the velocity limit (n, m).
    """

    varied: np.ndarray
    value: np.ndarray
    angles: np.ndarray
    stable: np.ndarray
    bandwidth: np.ndarray
    gain: np.ndarray
    damping: np.ndarray
    cross: np.ndarray
    relative_gain: np.ndarray
    interval: np.ndarray
    stick_bandwidth: np.ndarray
    distortion: np.ndarray
    slewing: np.ndarray

    def __len__(self) -> int:
        return len(self.varied)

    def rows(self, *varied: str) -> "MapTable":
        """Return the rows in which one of these varies."""
        kept = np.isin(self.varied, varied)
        return MapTable(**{name: column[kept] for name, column in vars(self).items()})

    def of(self, joint: str, quantity: str = "bandwidth") -> np.ndarray:
        """Return a quantity of one joint (n,); by default its bandwidth, Hz."""
        return np.asarray(vars(self)[quantity][:, MOVING.index(joint)])

    @property
    def held(self) -> np.ndarray:
        """Whether the drives hold the arm (n,)."""
        return np.asarray(np.isfinite(self.gain).all(axis=1))

    @property
    def interaction(self) -> np.ndarray:
        """Distance of the relative gain from one at each joint's bandwidth (n, m)."""
        return np.abs(self.relative_gain - 1.0)

    def text(self) -> str:
        """Return the table as CSV: a line for each operating point and joint, an empty cell where there is no value."""
        columns = {
            "bandwidth_hz": self.bandwidth,
            "gain": self.gain,
            "damping_ratio": self.damping,
            **{f"cross_gain_from_{name}": self.cross[:, :, j] for j, name in enumerate(MOVING)},
            "relative_gain_distance": self.interaction,
            "ci95_low_hz": self.interval[:, :, 0],
            "ci95_high_hz": self.interval[:, :, 1],
            "bandwidth_from_stick_hz": self.stick_bandwidth,
            "distortion_percent": self.distortion,
            "velocity_limited_share": self.slewing,
        }
        angle_headings = [f"{name}_deg" for name in JOINTS]
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(("varied", "value", "unit", *angle_headings, "stable", "joint", *columns))
        for k, varied in enumerate(self.varied):
            value = self.value[k]
            if not isinstance(value, str):
                value = _cell(value)
            pose = [f"{angle:.4g}" for angle in np.degrees(self.angles[k])]
            point = (varied, value, UNITS.get(varied, ""), *pose, int(self.stable[k]))
            for i, joint in enumerate(MOVING):
                quantities = [_cell(values[k, i]) for values in columns.values()]
                writer.writerow((*point, joint, *quantities))
        return buffer.getvalue()


def _cell(value: float) -> str:
    """Print a number for a cell of the table, which stays empty where there is none."""
    return f"{value:.6g}" if np.isfinite(value) else ""


def table_row(varied: str, value: float | str, angles: np.ndarray, stable: bool, **quantities: np.ndarray) -> MapTable:
    """Return a table of one operating point; quantities that are left out are NaN."""
    filled = {}
    for name, shape in SHAPES.items():
        quantity = quantities.get(name, np.full(shape, np.nan))
        filled[name] = quantity[None]
    # Numbers and names in one column: without the dtype NumPy would make texts of the numbers.
    values = np.empty(1, dtype=object)
    values[0] = value
    return MapTable(np.array([varied]), values, np.array(angles)[None], np.array([stable]), **filled)


def stacked(tables: Iterable[MapTable]) -> MapTable:
    """Join tables one after another."""
    tables = list(tables)
    columns = {}
    for name in vars(tables[0]):
        columns[name] = np.concatenate([vars(table)[name] for table in tables])
    return MapTable(**columns)


def linear_row(varied: str, value: float | str, arm: Arm, pose: np.ndarray) -> MapTable:
    """Linearise an arm at one pose (7,), rad; where its drives cannot hold it, the row is a gap.

    Raises:
        TwinError: The pose is not seven finite angles within the joints' ranges.
    """
    try:
        return truth_row(varied, value, linearize(arm, pose, amplitudes=()))
    except OverloadError:
        return table_row(varied, value, pose, False)


def truth_row(varied: str, value: float | str, truth: Truth) -> MapTable:
    """Describe one linear model."""
    model = truth.model

    def moving_response(frequencies: np.ndarray) -> np.ndarray:
        return np.asarray(model.frequency_response(frequencies)[:, COLUMNS[:, None], COLUMNS])

    # Short of the Nyquist frequency, beyond which the response warns.
    grid = np.geomspace(0.02, 0.999 * 0.5 / model.dt, 50)
    # The end of the band of cross gains is no point of the grid, and a cross gain may be largest there.
    frequencies = np.unique(np.concatenate([grid, [CROSS_BAND]]))
    response = moving_response(np.concatenate([[0.0], frequencies]))
    still, swept = response[0], response[1:]
    gain = np.diagonal(still).real
    z, vectors = np.linalg.eig(model.A)
    stable = bool(np.abs(z).max() < 1.0)
    # The response of an unstable model is defined, but no signal shows it.
    bandwidth = np.full(M, np.nan)
    if stable:
        relative = np.abs(np.diagonal(swept, axis1=1, axis2=2)) / gain
        bandwidth = _bandwidth(moving_response, frequencies, relative)
    cross = np.abs(swept[frequencies <= CROSS_BAND]).max(axis=0) / np.abs(gain)[:, None]
    cross = np.where(np.eye(M, dtype=bool), 0.0, cross)
    return table_row(
        varied,
        value,
        truth.angles,
        stable,
        bandwidth=bandwidth,
        gain=gain,
        damping=_damping(truth, z, vectors, gain),
        cross=cross,
        relative_gain=_relative_gain(moving_response, bandwidth),
    )


def _relative_gain(moving_response: Callable[[np.ndarray], np.ndarray], bandwidth: np.ndarray) -> np.ndarray:
    """Diagonal of the relative gain array G * (G^-1)' at each joint's own bandwidth (m,) [Bristol1966]."""
    relative_gain = np.full(M, np.nan, dtype=complex)
    joints = np.flatnonzero(np.isfinite(bandwidth))
    # An unstable arm has no bandwidth at all, and no frequency makes no array of matrices to invert.
    if len(joints):
        G = moving_response(bandwidth[joints])
        diagonal = (np.arange(len(joints)), joints, joints)
        relative_gain[joints] = G[diagonal] * np.linalg.inv(G)[diagonal]
    return relative_gain


def _bandwidth(
    moving_response: Callable[[np.ndarray], np.ndarray], frequencies: np.ndarray, relative: np.ndarray
) -> np.ndarray:
    """Find the half-power frequency of all joints at once by false position (m,), Hz; NaN where a gain stays above.

    Args:
        moving_response: Response of the moving joints at frequencies (n,), Hz.
        frequencies: A grid, Hz.
        relative: Gains on the grid over those at 0 Hz (n, m).
    """
    joints, target = np.arange(M), np.log(np.sqrt(0.5))
    below = relative < np.sqrt(0.5)
    first = np.argmax(below, axis=0)
    # Below half power already at the lowest frequency, a gain has no fall between two points of the grid.
    falls = below.any(axis=0) & (first > 0)
    low, high = frequencies[np.maximum(first - 1, 0)], frequencies[first]
    # |G|^2 is close to a straight line in log-log over so short an interval: the secant converges in a few steps.
    at_low, at_high = np.log(relative[first - 1, joints]), np.log(relative[first, joints])
    still = np.abs(np.diagonal(moving_response(np.zeros(1))[0]))
    for _ in range(REFINEMENTS):
        guess = np.exp(np.log(low) + (target - at_low) / (at_high - at_low) * np.log(high / low))
        at_guess = np.log(np.abs(moving_response(guess)[joints, joints, joints]) / still)
        below_half = at_guess < target
        low, at_low = np.where(below_half, low, guess), np.where(below_half, at_low, at_guess)
        high, at_high = np.where(below_half, guess, high), np.where(below_half, at_guess, at_high)
        # Nine digits of the gain; the table prints six of the bandwidth.
        if np.abs(at_guess - target)[falls].max(initial=0.0) < 1e-9:
            break
    return np.where(falls, guess, np.nan)


def _damping(truth: Truth, z: np.ndarray, vectors: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """Smallest damping ratio of each joint's slow poles; poles z and eigenvectors are those of the model.

    With A V = V diag(z), the mode k carries C v_k w_k B / (1 - z_k) of the gain at 0 Hz, w_k the row of V^-1.
    """
    model = truth.model
    # A pole at z = 0 is a delay of the bus; it has no image in the s plane.
    moving = np.abs(z) > 1e-6
    s = np.zeros(len(z), dtype=complex)
    s[moving] = np.log(z[moving].astype(complex)) / model.dt
    slow = moving & (np.abs(s) < FAST)
    # V^-1 B by least squares: V may be close to singular (its condition is 2e10 on the flight arm).
    weights = np.linalg.lstsq(vectors, model.B[:, COLUMNS].astype(complex), rcond=None)[0]
    outputs = model.C[COLUMNS] @ vectors
    still_gains = outputs[:, slow] * weights[slow].T / (1.0 - z[slow])
    share = np.abs(still_gains) / np.abs(gain)[:, None]
    s = s[slow]
    # The imaginary part of a real pole is rounding.
    ratio = np.where(np.abs(s.imag) < 1e-6, 1.0, -s.real / np.abs(s))
    # A joint whose modes are all fast or faint swings as one with real poles does: not at all.
    return np.where(share > MODE_SHARE, ratio, 1.0).min(axis=1, initial=1.0)
