"""Controllers designed from identified models, which make a plant answer like a reference model."""

from sysid.control.adaptive import AdaptiveFollowing, AdaptiveRun
from sysid.control.controller import Controller, ControllerRun
from sysid.control.model_following import FollowingDesign, model_following
from sysid.control.vrft import VirtualReferenceDesign, vrft

__all__ = [
    "AdaptiveFollowing",
    "AdaptiveRun",
    "Controller",
    "ControllerRun",
    "FollowingDesign",
    "VirtualReferenceDesign",
    "model_following",
    "vrft",
]
