"""Byte offsets of array pointers inside MuJoCo's structures, from the field declarations of its Python package."""

import ctypes
from collections.abc import Mapping
from typing import Any

import mujoco
from mujoco.introspect.ast_nodes import AnonymousStructDecl, ArrayType, PointerType, StructDecl, StructFieldDecl
from mujoco.introspect.structs import STRUCTS

from hmtb_twin.files.errors import TwinError

MODEL_ARRAYS = ("actuator_dynprm", "actuator_user")
"""Arrays of `mjModel` that the drives' equations read."""

DATA_ARRAYS = ("act", "act_dot", "ctrl", "actuator_length", "actuator_velocity")
"""Arrays of `mjData` that the drives' equations read and write."""

_SCALARS: Mapping[str, Any] = {
    "int": ctypes.c_int,
    "float": ctypes.c_float,
    "size_t": ctypes.c_size_t,
    "uint64_t": ctypes.c_uint64,
    "uintptr_t": ctypes.c_size_t,
    "mjtBool": ctypes.c_bool,
    "mjtByte": ctypes.c_ubyte,
    "mjtNum": ctypes.c_double,
    "mjtSize": ctypes.c_int64,
}
"""C types of single numbers; `ctypes` adds the padding of the platform's compiler between them."""

# Each array of the probe has elements of its own: arrays without any share the address of the array behind them.
_PROBE = """
<mujoco>
  <worldbody><body><joint name="joint"/><geom size="0.1"/></body></worldbody>
  <actuator><general joint="joint" dyntype="user" actdim="3" user="1 2 3 4"/><general joint="joint"/></actuator>
</mujoco>
"""

_REMEDY = "the arm's drives cannot run on it: use another version"


def struct_offsets() -> Mapping[str, int]:
    """Return the byte offset of each array's pointer inside `mjModel` and `mjData`.

    The offsets follow from the order and types of the fields, which differ between versions of MuJoCo. On a small model
    each pointer is compared with the address that the Python bindings show: declarations that do not belong to the
    library would otherwise let the drives write into foreign memory.

    Returns:
        Byte offset by array name, for `MODEL_ARRAYS` and `DATA_ARRAYS`.

    Raises:
        TwinError: A field is not declared or of unknown type, or a pointer is not where its declaration puts it.
    """
    model = mujoco.MjModel.from_xml_string(_PROBE)
    data = mujoco.MjData(model)
    offsets = {**declared_offsets("mjModel", MODEL_ARRAYS), **declared_offsets("mjData", DATA_ARRAYS)}
    check_pointers(model, {name: offsets[name] for name in MODEL_ARRAYS})
    check_pointers(data, {name: offsets[name] for name in DATA_ARRAYS})
    return offsets


def declared_offsets(struct: str, arrays: tuple[str, ...]) -> dict[str, int]:
    """Return the byte offsets of fields of one MuJoCo structure, computed from its declaration.

    Args:
        struct: Name of the structure.
        arrays: Names of fields.

    Raises:
        TwinError: The structure or a field is not declared, or a type is unknown.
    """
    try:
        layout = _layout(STRUCTS[struct])
        return {name: getattr(layout, name).offset for name in arrays}
    except (KeyError, AttributeError) as error:
        raise TwinError(
            f"{_mujoco_version()} does not declare its {struct} as expected: a structure, field or type is unknown "
            f"({error}); {_REMEDY}"
        ) from error


def _layout(struct: StructDecl | AnonymousStructDecl) -> type[ctypes.Structure]:
    """Return the `ctypes` structure of a declared C structure; raises `KeyError` for an undeclared field type."""
    fields = []
    for field in struct.fields:
        # Unions have no place here: neither structure contains any, and a future one is reported as unknown.
        if not isinstance(field, StructFieldDecl):
            raise KeyError(f"{type(field).__name__} in {struct}")
        fields.append((field.name, _c_type(field.type)))
    return type("Layout", (ctypes.Structure,), {"_fields_": fields})


def _c_type(declared: Any) -> Any:
    """Return the `ctypes` type of a declared C type; raises `KeyError` if it is unknown."""
    if isinstance(declared, PointerType):
        return ctypes.c_void_p
    if isinstance(declared, ArrayType):
        array = _c_type(declared.inner_type)
        for extent in reversed(declared.extents):
            array = array * extent
        return array
    if isinstance(declared, AnonymousStructDecl):
        return _layout(declared)
    if declared.name in _SCALARS:
        return _SCALARS[declared.name]
    return _layout(STRUCTS[declared.name])


def check_pointers(struct: Any, offsets: Mapping[str, int]) -> None:
    """Check that the pointer at each offset is the address of its array; raises `TwinError` otherwise.

    Args:
        struct: An `MjModel` or `MjData`.
        offsets: Byte offset by array name; each array must have elements.

    Raises:
        TwinError: A pointer is not that of its array.
    """
    base = getattr(struct, "_address", None)
    if not isinstance(base, int):
        raise TwinError(f"{_mujoco_version()} does not expose the address of its {type(struct).__name__}; {_REMEDY}")
    for name, offset in offsets.items():
        pointer = ctypes.c_void_p.from_address(base + offset).value
        if pointer != getattr(struct, name).ctypes.data:
            raise TwinError(
                f"{_mujoco_version()} does not keep {name} in its {type(struct).__name__} where it declares it; "
                f"{_REMEDY}"
            )


def _mujoco_version() -> str:
    """Name and version of MuJoCo, for messages."""
    return f"MuJoCo {mujoco.__version__}"
