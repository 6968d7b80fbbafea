"""Estimators of polynomial models: least squares, instrumental variables, prediction errors."""

from sysid.polynomial.ar import ar
from sysid.polynomial.arma import arma
from sysid.polynomial.armax import armax
from sysid.polynomial.arx import arx
from sysid.polynomial.bj import bj
from sysid.polynomial.data_checks import order_of_excitation
from sysid.polynomial.fit_with_offset import fit_with_offset
from sysid.polynomial.impulseest import impulseest
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.iv4 import iv4
from sysid.polynomial.ivx import ivx
from sysid.polynomial.oe import oe
from sysid.polynomial.polyest import polyest
from sysid.polynomial.structures import Embedding, embedding
from sysid.polynomial.two_stage import two_stage

__all__ = [
    "Embedding",
    "InitialConditions",
    "ar",
    "arma",
    "armax",
    "arx",
    "bj",
    "embedding",
    "fit_with_offset",
    "impulseest",
    "iv4",
    "ivx",
    "oe",
    "order_of_excitation",
    "polyest",
    "two_stage",
]
