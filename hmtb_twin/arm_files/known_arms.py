"""Arms by name: those of the test bed."""

from hmtb_twin.files.errors import TwinError, shown
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.variants import VARIANTS


def arm_named(name: str) -> ArmDescription:
    """Return an arm by name; raises `TwinError` for an unknown one."""
    if not isinstance(name, str) or name not in VARIANTS:
        raise TwinError(f"unknown variant {shown(name)}, available: {', '.join(VARIANTS)}")
    return VARIANTS[name]
