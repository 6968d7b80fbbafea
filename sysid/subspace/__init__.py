"""State-space estimators: subspace and realisation methods, and their prediction-error refinement."""

from sysid.subspace.era import Realisation, era, era_dc
from sysid.subspace.n4sid import n4sid
from sysid.subspace.okid import okid
from sysid.subspace.pem_ss import pem_ss

__all__ = [
    "Realisation",
    "era",
    "era_dc",
    "n4sid",
    "okid",
    "pem_ss",
]
