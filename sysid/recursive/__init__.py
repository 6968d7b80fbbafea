"""Recursive estimators: parameters that follow the data sample by sample."""

from sysid.recursive.adaptation import Forgetting, Gradient, Kalman
from sysid.recursive.estimators import rarmax, rarx, roe
from sysid.recursive.recursive_estimate import RecursiveEstimate, RecursiveState

__all__ = ["Forgetting", "Gradient", "Kalman", "RecursiveEstimate", "RecursiveState", "rarmax", "rarx", "roe"]
