"""Choice of delay, structure and orders among the estimators."""

from sysid.selection.auto import StructureChoice, auto
from sysid.selection.structure_search import Candidate

__all__ = ["Candidate", "StructureChoice", "auto"]
