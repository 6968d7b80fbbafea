"""Validation of estimates: residual tests, fits to data, orders, identifiability, independence of inputs, bounds."""

from sysid.validation.compare import ModelFit, compare, fit_percent
from sysid.validation.cramer_rao import CramerRaoBound, cramer_rao_bound
from sysid.validation.cross_validation import CrossValidation, cross_validate
from sysid.validation.feedback import FeedbackTest, feedback
from sysid.validation.homogeneity import HomogeneityTest, homogeneity
from sysid.validation.identifiability import Identifiability, identifiability
from sysid.validation.input_independence import InputIndependence, input_independence
from sysid.validation.model_error import ModelError, model_error
from sysid.validation.resid import ResidualTest, resid
from sysid.validation.selstruc import selstruc
from sysid.validation.structure_scan import StructureTable, choose_orders, structure_scan

__all__ = [
    "CramerRaoBound",
    "CrossValidation",
    "FeedbackTest",
    "HomogeneityTest",
    "Identifiability",
    "InputIndependence",
    "ModelError",
    "ModelFit",
    "ResidualTest",
    "StructureTable",
    "choose_orders",
    "compare",
    "cramer_rao_bound",
    "cross_validate",
    "feedback",
    "fit_percent",
    "homogeneity",
    "identifiability",
    "input_independence",
    "model_error",
    "resid",
    "selstruc",
    "structure_scan",
]
