"""Validation of estimates: residual tests, fits to data, choice of orders, identifiability."""

from sysid.validation.compare import ModelFit, compare, fit_percent
from sysid.validation.cross_validation import CrossValidation, cross_validate
from sysid.validation.identifiability import Identifiability, identifiability
from sysid.validation.resid import ResidualTest, resid
from sysid.validation.selstruc import selstruc
from sysid.validation.structure_scan import StructureTable, structure_scan

__all__ = [
    "CrossValidation",
    "Identifiability",
    "ModelFit",
    "ResidualTest",
    "StructureTable",
    "compare",
    "cross_validate",
    "fit_percent",
    "identifiability",
    "resid",
    "selstruc",
    "structure_scan",
]
