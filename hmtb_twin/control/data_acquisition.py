"""The data acquisition board of the excitation computer: its analogue outputs.

The thesis used an AT-MIO-16 [Morris1996, sec. II.3]; the numbers here are those of its successor, the AT-MIO-16D.
"""

from dataclasses import dataclass

import numpy as np

from hmtb_twin.parameters.quantity import quantity


@dataclass(frozen=True)
class DataAcquisitionBoard:
    """The digital-to-analogue converters that drive the hand controller in place of an operator."""

    outputs: int = quantity(2, "1", "analogue", "AT-MIO-16D: two analogue outputs")
    dac_bits: int = quantity(12, "bit", "analogue", "AT-MIO-16D: 12-bit converters")
    dac_range: float = quantity(10.0, "V", "analogue", "AT-MIO-16D with its internal 10 V reference, bipolar")

    @property
    def dac_step(self) -> float:
        """One count of the converter, V."""
        return 2.0 * self.dac_range / 2**self.dac_bits

    def convert(self, volts: np.ndarray, *, rounds: bool = True) -> np.ndarray:
        """Return the converter's output: whole counts from -range to range less one count.

        Args:
            volts: Requested voltage, any shape, V.
            rounds: Whether the converter rounds; it always saturates.

        Returns:
            Output, same shape, V.
        """
        counts = volts / self.dac_step
        if rounds:
            counts = np.rint(counts)
        # Two's complement: the largest voltage is one count below the range.
        limit = 2 ** (self.dac_bits - 1)
        return self.dac_step * np.clip(counts, -limit, limit - 1)

    def exceeds_range(self, volts: np.ndarray) -> np.ndarray:
        """Return which requested voltages lie outside the range by half a count or more; same shape, bool."""
        return (volts < -self.dac_range - self.dac_step / 2) | (volts >= self.dac_range - self.dac_step / 2)


BOARD = DataAcquisitionBoard()
