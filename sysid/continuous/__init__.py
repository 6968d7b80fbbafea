"""Estimators of continuous-time models: transfer functions with delays, and process models."""

from sysid.continuous.procest import procest
from sysid.continuous.tfest import tfest

__all__ = ["procest", "tfest"]
