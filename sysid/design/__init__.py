"""Input design: excitation signals, and inputs that minimise the predicted variance of a quantity."""

from sysid.design.design_input import InputDesign, design_input
from sysid.design.idinput import InputSignal, idinput, maximum_length_sequence
from sysid.design.multisine import sum_of_sines

__all__ = ["InputDesign", "InputSignal", "design_input", "idinput", "maximum_length_sequence", "sum_of_sines"]
