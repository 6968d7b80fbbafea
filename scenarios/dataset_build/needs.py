"""What has to be installed for a data set, looked for before anything is made."""

from hmtb_twin.orifice import require_compiler
from scenarios.datasets.spec import DataSetSpec


def check_installed(spec: DataSetSpec) -> None:
    """Refuse a spec for which an extra of this package is missing: without it every experiment would fail.

    Args:
        spec: The spec.

    Raises:
        TwinError: Servo valves are asked for, and what compiles their equations is not there.
    """
    if any("orifice" in block.actuators for block in spec.records):
        require_compiler()
