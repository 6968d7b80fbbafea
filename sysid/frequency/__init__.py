"""Nonparametric estimators: frequency responses, spectra, correlations, delays."""

from sysid.frequency.bla import BestLinearApproximation, bla
from sysid.frequency.covf import CovarianceFunction, covf
from sysid.frequency.cra import ImpulseResponse, cra
from sysid.frequency.delayest import DelayEstimate, delayest
from sysid.frequency.etfe import etfe
from sysid.frequency.lpm import lpm
from sysid.frequency.merge import merge
from sysid.frequency.spa import spa
from sysid.frequency.spafdr import spafdr
from sysid.frequency.vector_fit import PartialFractions, vector_fit
from sysid.frequency.welch import welch

__all__ = [
    "BestLinearApproximation",
    "CovarianceFunction",
    "DelayEstimate",
    "ImpulseResponse",
    "PartialFractions",
    "bla",
    "covf",
    "cra",
    "delayest",
    "etfe",
    "lpm",
    "merge",
    "spa",
    "spafdr",
    "vector_fit",
    "welch",
]
