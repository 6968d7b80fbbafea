"""Files and errors: NetCDF4 whose bytes depend on its contents alone, atomic writes, hashes."""

from hmtb_twin.files.errors import OverloadError, TwinError, TwinWarning

__all__ = ["OverloadError", "TwinError", "TwinWarning"]
