"""Estimators of continuous-time models: transfer functions with delays, and process models."""

from sysid.continuous.tfest import tfest

__all__ = ["tfest"]
