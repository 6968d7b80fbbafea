"""Offsets of arrays inside MuJoCo's structures, which differ between versions and are therefore searched in memory."""

import ctypes
from collections.abc import Callable, Mapping
from typing import Any

import mujoco

from hmtb_twin.files.errors import TwinError

MODEL_ARRAYS = ("actuator_dynprm", "actuator_user")
"""Arrays of `mjModel` that the drives' equations read."""

DATA_ARRAYS = ("act", "act_dot", "ctrl", "actuator_length", "actuator_velocity")
"""Arrays of `mjData` that the drives' equations read and write."""

LARGEST_STRUCT = 1 << 20
"""Bytes after which the search for a pointer stops."""

_WORD = ctypes.sizeof(ctypes.c_void_p)

_PROBE = """
<mujoco>
  <worldbody>{bodies}</worldbody>
  <actuator>{actuators}</actuator>
</mujoco>
"""


def struct_offsets() -> Mapping[str, int]:
    """Find the byte offset of each array's pointer inside `mjModel` and `mjData`.

    Each structure of a small model is searched, word by word, for the address of the array that the Python bindings
    show. A second model of other sizes must have the same pointers in the same places.

    Returns:
        Byte offset by array name, for `MODEL_ARRAYS` and `DATA_ARRAYS`.

    Raises:
        TwinError: A pointer is not found, is found in two places, or moves between models.
    """
    small, large = _offsets(joints=2), _offsets(joints=5)
    different = sorted(name for name in small if small[name] != large[name])
    if different:
        raise TwinError(f"{_mujoco()} keeps {', '.join(different)} at places that differ between models; {_REMEDY}")
    return small


def _offsets(joints: int) -> dict[str, int]:
    bodies = "".join(f'<body><joint name="j{k}"/><geom size="0.1"/></body>' for k in range(joints))
    actuators = "".join(
        f'<general joint="j{k}" dyntype="user" actdim="3" user="1 2 3 4"/><general joint="j{k}"/>'
        for k in range(joints)
    )
    model = mujoco.MjModel.from_xml_string(_PROBE.format(bodies=bodies, actuators=actuators))
    data = mujoco.MjData(model)
    return {**pointer_offsets(model, MODEL_ARRAYS), **pointer_offsets(data, DATA_ARRAYS)}


def pointer_offsets(struct: Any, names: tuple[str, ...], read: Callable[[int], int] | None = None) -> dict[str, int]:
    """Find the byte offsets of array pointers inside one MuJoCo structure.

    Args:
        struct: An `MjModel` or `MjData`.
        names: Arrays to find; each must have elements.
        read: Reads the word at an address; memory itself by default.

    Returns:
        Byte offset by array name.

    Raises:
        TwinError: A pointer is not found, or is found in two places.
    """
    base = getattr(struct, "_address", None)
    if not isinstance(base, int):
        raise TwinError(f"{_mujoco()} does not expose the address of its {type(struct).__name__}; {_REMEDY}")
    read = read or (lambda address: ctypes.c_size_t.from_address(address).value)
    addresses = {name: int(getattr(struct, name).ctypes.data) for name in names}
    offsets: dict[int, list[int]] = {address: [] for address in addresses.values()}
    # The search ends behind the last pointer found, so that it stays within the structure.
    for offset in range(0, LARGEST_STRUCT, _WORD):
        word = read(base + offset)
        if word in offsets:
            offsets[word].append(offset)
        elif all(offsets.values()):
            break
    for name, address in addresses.items():
        places = offsets[address]
        # Arrays without elements have the address of the one that follows them in memory and in the structure.
        if not places or places[-1] - places[0] != _WORD * (len(places) - 1):
            raise TwinError(
                f"{_mujoco()} has {len(places)} pointers to {name} in its {type(struct).__name__}, expected one; "
                f"{_REMEDY}"
            )
    return {name: offsets[address][-1] for name, address in addresses.items()}


_REMEDY = "the arm's drives cannot run on it: use another version"


def _mujoco() -> str:
    return f"MuJoCo {mujoco.__version__}"
