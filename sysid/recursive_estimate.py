"""What `rarx`, `rarmax` and `roe` return."""

from dataclasses import dataclass

from sysid.arrays import FloatArray, lock
from sysid.estimate import Estimate


@dataclass(frozen=True, eq=False)
class RecursiveEstimate:
    """Parameters as they were known sample by sample.

    Attributes:
        parameters: Estimate from the data up to each sample (N, p).
        parameter_names: One name per parameter.
        residuals: Each output less its prediction by the parameters known before it (N, 1); zero before the first
            prediction.
        final: The last parameters as an estimate, with their covariance: a model like any other.
        shortened: Number of steps that had to be shortened to keep the predictor stable.
    """

    parameters: FloatArray
    parameter_names: tuple[str, ...]
    residuals: FloatArray
    final: Estimate
    shortened: int

    def __post_init__(self) -> None:
        """Lock."""
        object.__setattr__(self, "parameters", lock(self.parameters))
        object.__setattr__(self, "residuals", lock(self.residuals))
