"""Models as files: JSON, MATLAB, C and FMU."""

from sysid.exchange.c_source import to_c
from sysid.exchange.fmu import to_fmu
from sysid.exchange.matlab import to_matlab
from sysid.exchange.model_file import read_model, write_model

__all__ = ["read_model", "to_c", "to_fmu", "to_matlab", "write_model"]
