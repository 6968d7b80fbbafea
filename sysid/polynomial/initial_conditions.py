"""Assumptions of a fit about the time before a record."""

from enum import Enum

from sysid.records.arguments import shown
from sysid.records.errors import SysidError


class InitialConditions(Enum):
    """How the unknown past of each experiment enters the criterion.

    Attributes:
        ESTIMATED: As free initial conditions, fitted with the parameters: nothing is assumed.
        BACKCAST: Past disturbances have the variance that the disturbance model gives them, so that the first errors
            are unconditional ones [BoxJenkins1976, ch. 7]; the past of the input paths stays free. It matters in short
            records with slow disturbances only.
        ZERO: Inputs, outputs and disturbances were zero, and every sample counts. Right for an experiment that begins
            at rest, biased for one cut from the middle.
    """

    ESTIMATED = "estimated"
    BACKCAST = "backcast"
    ZERO = "zero"

    @staticmethod
    def of(value: "InitialConditions | str") -> "InitialConditions":
        """The member itself, or the member with this value.

        Raises:
            SysidError: Something else.
        """
        try:
            return InitialConditions(value)
        except ValueError as error:
            known = ", ".join(f"InitialConditions.{one.name} or {one.value!r}" for one in InitialConditions)
            raise SysidError(f"initial_conditions must be one of {known}; got {shown(value)}") from error
