"""Estimators of continuous-time models, and of models of either time from frequency responses."""

from sysid.continuous.fit_response import fit_response
from sysid.continuous.fit_response_ss import fit_response_ss
from sysid.continuous.procest import procest
from sysid.continuous.tfest import tfest
from sysid.polynomial.response_fits import register_response_fit

__all__ = ["fit_response", "fit_response_ss", "procest", "tfest"]

register_response_fit(fit_response)
