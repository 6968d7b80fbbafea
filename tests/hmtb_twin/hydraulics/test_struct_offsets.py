import ctypes

import mujoco
import numpy as np

from hmtb_twin import load_arm
from hmtb_twin.hydraulics import struct_offsets
from hmtb_twin.hydraulics.struct_offsets import DATA_ARRAYS, MODEL_ARRAYS, pointer_offsets
from tests.refusals import refused


def test_offsets_lead_to_the_arrays_of_any_model():
    offsets = struct_offsets.struct_offsets()
    model = load_arm(worksite=True).model
    data = mujoco.MjData(model)
    data.ctrl[:], data.act[:] = np.arange(model.nu), np.arange(model.na) + 0.5
    mujoco.mj_forward(model, data)
    for struct, names in ((model, ("actuator_dynprm",)), (data, DATA_ARRAYS)):
        for name in names:
            pointer = ctypes.c_size_t.from_address(struct._address + offsets[name]).value
            array = getattr(struct, name)
            values = np.ctypeslib.as_array(ctypes.cast(pointer, ctypes.POINTER(ctypes.c_double)), array.shape)
            np.testing.assert_array_equal(values, array)
            assert pointer == array.ctypes.data
    assert set(offsets) == {*MODEL_ARRAYS, *DATA_ARRAYS}


class Struct:
    """A structure of made-up words with two arrays."""

    def __init__(self, words):
        self.ctrl, self.act = np.zeros(2), np.zeros(3)
        addresses = {"ctrl": self.ctrl.ctypes.data, "act": self.act.ctypes.data}
        self.words = [addresses.get(word, word) for word in words]
        self._address = 0

    def read(self, address):
        return self.words[address // 8] if address // 8 < len(self.words) else 7


def test_pointers_missing_moving_or_in_two_places_are_errors_but_an_empty_array_may_share_its_address(monkeypatch):
    for words in ([1, "act", 2], [1, "ctrl", 2, "ctrl", "act", 3]):
        struct = Struct(words)
        refused(r"MuJoCo .* pointers to ctrl .*another version", pointer_offsets, struct, ("ctrl", "act"), struct.read)
    refused("address of its int", pointer_offsets, 3, ("ctrl",))
    monkeypatch.setattr(struct_offsets, "_offsets", lambda joints: {"act": 8 * joints})
    refused("keeps act at places that differ", struct_offsets.struct_offsets)
    struct = Struct([1, "act", 2, "ctrl", "ctrl", 3])
    assert pointer_offsets(struct, ("ctrl", "act"), struct.read) == {"ctrl": 32, "act": 8}
