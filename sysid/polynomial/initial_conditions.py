"""Assumptions of a fit about the time before a record."""

from enum import Enum

from sysid.records.arguments import shown
from sysid.records.errors import SysidError


class InitialConditions(Enum):
    """Assumption about the time before each experiment.

    Attributes:
        ESTIMATED: None: free initial conditions are fitted with the parameters.
        BACKCAST: The disturbance is stationary with the variance of its model, so that the first errors are
            unconditional ones [BoxJenkins1976, ch. 7]; the initial conditions of the input paths are free. It matters
            only for short records with slow disturbances.
        ZERO: Inputs, outputs and disturbances were zero, and every sample counts. Exact for an experiment that starts
            at rest, biased for a part of a longer one.
    """

    ESTIMATED = "estimated"
    BACKCAST = "backcast"
    ZERO = "zero"

    @staticmethod
    def of(value: "InitialConditions | str") -> "InitialConditions":
        """Member with the value "estimated", "backcast" or "zero"; a member is returned as it is.

        Raises:
            SysidError: Any other value.
        """
        try:
            return InitialConditions(value)
        except ValueError as error:
            choices = ", ".join(f"InitialConditions.{member.name} or {member.value!r}" for member in InitialConditions)
            raise SysidError(f"initial_conditions must be one of {choices}; got {shown(value)}") from error
