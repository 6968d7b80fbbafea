"""Recursive estimators: parameters that follow the data sample by sample."""

from sysid.recursive.adaptation import Forgetting, Gradient, Kalman
from sysid.recursive.rarmax import rarmax
from sysid.recursive.rarx import rarx
from sysid.recursive.recursive_estimate import RecursiveEstimate, RecursiveState
from sysid.recursive.roe import roe

__all__ = [
    "Forgetting",
    "Gradient",
    "Kalman",
    "RecursiveEstimate",
    "RecursiveState",
    "rarmax",
    "rarx",
    "roe",
]
