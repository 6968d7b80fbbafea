"""State-space estimators: subspace and realisation methods, and their prediction-error refinement."""

from sysid.subspace.cramer_rao_ss import cramer_rao_bound_ss
from sysid.subspace.era import Realisation, era, era_dc, markov_parameters
from sysid.subspace.n4sid import n4sid
from sysid.subspace.okid import okid
from sysid.subspace.pbsid import pbsid
from sysid.subspace.pem_ss import pem_ss

__all__ = [
    "Realisation",
    "cramer_rao_bound_ss",
    "era",
    "era_dc",
    "markov_parameters",
    "n4sid",
    "okid",
    "pbsid",
    "pem_ss",
]
