"""The Hammerstein loop: a known dead zone before a linear block, whose output is fed back to it.

The nominal servo valve has no overlap (`ServoValve.underlap` is 0): the twin has no dead band in the strict sense. What
it has is dry friction inside the position loop: a joint stands still until the torque kp (u - y) of the angle error
exceeds that of friction. Where inertia matters little beside damping d, d dy/dt = kp dz(u - y), with a dead zone dz of
half width Fc / kp: while the joint slides, Coulomb's torque Fc is what kp (u - y) loses.

The dead zone lies inside the loop, driven by the error. So this is no Hammerstein model from command to angle, but one
from error to angle [Giri2010] with the loop closed around it: the Hammerstein loop. Bristles that yield before they
slip [Canudas1995], and breakaway above Coulomb's torque, are not in it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

import sysid
from scenarios.files.errors import ScenarioError
from scenarios.identification.simulation_fit import compiled, fit_simulation, fit_to_window, settled
from sysid import IOData, Polynomials


@compiled
def simulate_loop(
    b: np.ndarray, f: np.ndarray, width: float, u: np.ndarray, standing: float
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate z = B(q)/F(q) v, v = dz(u - z), z having stood at an angle before.

    Args:
        b: Coefficients of v(t-1).. (nb,).
        f: Coefficients of z(t-1).. (nf,), on the left.
        width: Half width of the dead zone, rad.
        u: Commands (N,), rad.
        standing: The angle z before the first sample, rad.

    Returns:
        z (N,) and its derivatives with respect to b, f and the angle it stood at (N, nb + nf + 1). The derivative of dz
        at its edges is taken as 0.
    """
    nb, nf = len(b), len(f)
    z, v = np.empty(len(u)), np.empty(len(u))
    dz, dv = np.zeros((len(u), nb + nf + 1)), np.zeros((len(u), nb + nf + 1))
    for t in range(len(u)):
        value = 0.0
        for i in range(nf):
            past = t - 1 - i
            earlier = z[past] if past >= 0 else standing
            value -= f[i] * earlier
            dz[t, nb + i] -= earlier
            if past >= 0:
                dz[t] -= f[i] * dz[past]
            else:
                dz[t, nb + nf] -= f[i]
        for j in range(nb):
            past = t - 1 - j
            if past >= 0:
                value += b[j] * v[past]
                dz[t, j] += v[past]
                dz[t] += b[j] * dv[past]
        z[t] = value
        error = u[t] - value
        v[t] = 0.0
        if abs(error) > width:
            v[t] = error - width if error > 0.0 else error + width
            dv[t] = -dz[t]
    return z, dz


@dataclass(frozen=True, eq=False)
class HammersteinLoop:
    """y(t) = z(t - nk + 1) + level, z = B(q)/F(q) dz(u - command - z).

    The level, the measured angle in the middle of the dead zone, is each record's own: it shifts with the amplitude of
    the motion, by 3 to 4 mrad from the smallest to the largest motion of hmtb-nonlinear-v1.

    Attributes:
        theta: Coefficients of B from q^-1 on, then those of F (nb + nf,).
        nb: Coefficients of B.
        delay: Samples from the angle z to its measurement, nk - 1.
        width: Half width of the dead zone, rad.
        command: Mean command of the training records, rad.
        level: Mean level of the training records, rad.
        spread: Standard deviation of their outputs, rad.
    """

    theta: np.ndarray
    nb: int
    delay: int
    width: float
    command: float
    level: float
    spread: float

    def simulated(self, theta: np.ndarray, own: np.ndarray, record: IOData) -> tuple[np.ndarray, np.ndarray]:
        """Simulate a record; `own` holds its level and the angle z where the joint stood before (2,), rad."""
        level, standing = own
        u = record.u[:, 0] - self.command
        z, slopes = simulate_loop(theta[: self.nb], theta[self.nb :], self.width, u, standing)
        before = np.zeros((self.delay, slopes.shape[1]))
        before[:, -1] = 1.0
        z = np.concatenate([np.full(self.delay, standing), z])[: len(u)]
        slopes = np.concatenate([before, slopes])[: len(u)]
        return z + level, np.column_stack([slopes[:, :-1], np.ones(len(u)), slopes[:, -1]])

    def predicted(self, record: IOData, steps: int) -> np.ndarray:
        """Return the simulated outputs (N, 1) whatever the horizon: there is no noise model.

        Level and standing angle are fitted to the window; without one the joint stands at the mean level.

        Raises:
            ScenarioError: The simulation diverges.
        """
        own = fit_to_window(self.simulated, self.theta, np.array([self.level, 0.0]), record)
        output, _ = self.simulated(self.theta, own, record)
        orders = f"{self.nb}/{len(self.theta) - self.nb}/{self.delay + 1}"
        return settled(output, record, f"hammerstein:{orders}", self.level, self.spread)[:, None]


def hammerstein_loop(
    records: Sequence[IOData], nb: int, nf: int, nk: int, *, widths: Sequence[float], width: float
) -> HammersteinLoop:
    """Fit the linear block of a loop with a known dead zone, from the output-error model that has none.

    Without the dead zone the loop B/F has the transfer function B/(F + B); so F starts at the denominator of `oe` less
    its numerator, and a dead zone of no width gives the model of `oe` again.

    Args:
        records: Records of one joint.
        nb: Coefficients of B.
        nf: Degree of F, at least nb.
        nk: Delay in samples from command to measurement, at least 1.
        widths: Half width of the dead zone of each record's arm, rad.
        width: That of the arm to predict, rad.

    Raises:
        ScenarioError: Several inputs or outputs, nb above nf, nk below 1, no widths.
        SysidError: `oe` refuses the records.
    """
    first = records[0]
    if first.nu != 1 or first.ny != 1:
        raise ScenarioError(f"hammerstein takes one joint; records of {first.nu} inputs and {first.ny} outputs given")
    if not 1 <= nb <= nf or nk < 1:
        raise ScenarioError(
            f"hammerstein: nb = {nb}, nf = {nf}, nk = {nk} given, expected 1 <= nb <= nf, because F is the denominator "
            "of the closed loop less B, and nk >= 1, because the angle answers a command a sample later at the earliest"
        )
    if len(widths) != len(records):
        raise ScenarioError(f"hammerstein: {len(widths)} widths of the dead zone given for {len(records)} records")
    command = float(np.concatenate([record.u for record in records]).mean())
    levels = [float(record.y.mean() - record.u.mean()) + command for record in records]
    centred = [record.subtract(u=record.u.mean(axis=0), y=record.y.mean(axis=0)) for record in records]
    start = sysid.oe(centred, nb, nf, nk)
    polynomials = start.polynomials or Polynomials()
    b = polynomials.B[nk:]
    # F of the open loop is the closed denominator less B.
    theta = np.array([*b, *(polynomials.F[1:] - np.pad(b, (0, nf - nb)))])
    spread = float(np.concatenate([record.y for record in records]).std())
    model = HammersteinLoop(theta, nb, nk - 1, width, command, 0.0, spread)
    # Every arm has a dead zone of its own, and the loop its coefficients.
    loops = [replace(model, width=of_arm) for of_arm in widths]
    simulations = {id(record): loop.simulated for record, loop in zip(records, loops, strict=True)}

    def simulate(shared: np.ndarray, private: np.ndarray, record: IOData) -> tuple[np.ndarray, np.ndarray]:
        return simulations[id(record)](shared, private, record)

    starts = [np.array([level, 0.0]) for level in levels]
    theta, fitted = fit_simulation(simulate, theta, starts, records)
    return replace(model, theta=theta, level=float(np.mean([private[0] for private in fitted])))
