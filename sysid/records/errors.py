"""Error and warning classes of the package."""


class SysidError(ValueError):
    """Root of the errors of the package: each says what was given and what was expected."""


class SysidWarning(UserWarning):
    """Root of the warnings on numerics and data: poor excitation, rank, conditioning, instability."""
