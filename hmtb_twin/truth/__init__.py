"""Linear truth about the arm: small-signal model, noise model, poles and bandwidths; hydraulics in closed form."""

from hmtb_twin.truth.analytic_hydraulics import LinearHydraulics
from hmtb_twin.truth.linearization import linearize
from hmtb_twin.truth.truth import JointTruth, Truth

__all__ = ["JointTruth", "LinearHydraulics", "Truth", "linearize"]
