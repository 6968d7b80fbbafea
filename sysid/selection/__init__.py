"""Choice of delay, structure and orders among the estimators."""

from sysid.selection.auto import StructureChoice, auto
from sysid.selection.continuous_time import choose_procest, choose_tfest
from sysid.selection.impulse_length import choose_impulseest
from sysid.selection.structure_search import Candidate

__all__ = ["Candidate", "StructureChoice", "auto", "choose_impulseest", "choose_procest", "choose_tfest"]
