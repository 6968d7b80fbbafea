"""What a fit assumes about the time before a record."""

from enum import Enum

from sysid.records.arguments import shown
from sysid.records.errors import SysidError


class Past(Enum):
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
    def of(value: "Past | str") -> "Past":
        """The choice itself, or the one of this value.

        Raises:
            SysidError: Something else.
        """
        try:
            return Past(value)
        except ValueError as error:
            known = ", ".join(f"Past.{one.name} or {one.value!r}" for one in Past)
            raise SysidError(f"past must be one of {known}; got {shown(value)}") from error
