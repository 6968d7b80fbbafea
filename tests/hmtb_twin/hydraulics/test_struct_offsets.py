import ctypes

import mujoco
import numpy as np
from mujoco.introspect.ast_nodes import ArrayType, PointerType, StructDecl, StructFieldDecl, ValueType

from hmtb_twin import load_arm
from hmtb_twin.hydraulics import struct_offsets
from hmtb_twin.hydraulics.struct_offsets import DATA_ARRAYS, MODEL_ARRAYS, check_pointers, declared_offsets
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


def test_unknown_declarations_and_pointers_elsewhere_are_errors(monkeypatch):
    refused("does not declare its mjNothing as expected.*another version", declared_offsets, "mjNothing", ("act",))
    refused("does not declare its mjData as expected.*another version", declared_offsets, "mjData", ("act", "nothing"))
    number = StructDecl("mjData", "struct mjData_", [StructFieldDecl("act", ValueType("mjtUnknown"), "")])
    monkeypatch.setitem(struct_offsets.STRUCTS, "mjData", number)
    refused("mjtUnknown.*another version", declared_offsets, "mjData", ("act",))
    data = mujoco.MjData(load_arm().model)
    refused("does not keep act in its MjData.*another version", check_pointers, data, {"act": 0})
    refused("address of its int", check_pointers, 3, {"act": 0})


def test_padding_arrays_and_inner_structures_have_the_sizes_of_c(monkeypatch):
    point = StructDecl("Point", "struct Point", [StructFieldDecl("x", ArrayType(ValueType("float"), (3,)), "")])
    fields = [
        StructFieldDecl("flag", ValueType("mjtBool"), ""),
        StructFieldDecl("points", ArrayType(ValueType("Point"), (2, 2)), ""),
        StructFieldDecl("small", ValueType("mjtByte"), ""),
        StructFieldDecl("act", PointerType(ValueType("mjtNum")), ""),
        StructFieldDecl("ctrl", PointerType(ValueType("mjtNum")), ""),
    ]
    monkeypatch.setitem(struct_offsets.STRUCTS, "Point", point)
    monkeypatch.setitem(struct_offsets.STRUCTS, "mjData", StructDecl("mjData", "struct mjData_", fields))
    # A byte, padding to 4, four points of 12 bytes, a byte at 52, padding to 56.
    assert declared_offsets("mjData", ("points", "small", "act", "ctrl")) == {
        "points": 4,
        "small": 52,
        "act": 56,
        "ctrl": 64,
    }
