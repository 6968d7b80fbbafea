"""Recursive estimators: parameters that follow the data sample by sample."""

from sysid.recursive.adaptation import DirectionalForgetting, Forgetting, Gradient, Kalman
from sysid.recursive.estimators import rarmax, rarx, roe
from sysid.recursive.recursive_estimate import RecursiveEstimate, RecursiveState
from sysid.recursive.track import Track, track
from sysid.recursive.tracker import Change, Tracker, TrackSample

__all__ = [
    "Change",
    "DirectionalForgetting",
    "Forgetting",
    "Gradient",
    "Kalman",
    "RecursiveEstimate",
    "RecursiveState",
    "Track",
    "TrackSample",
    "Tracker",
    "rarmax",
    "rarx",
    "roe",
    "track",
]
