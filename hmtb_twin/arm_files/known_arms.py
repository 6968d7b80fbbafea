"""Arms by name: those of the test bed, those of `models`, those of example-robot-data, and anyone's files."""

from collections.abc import Mapping
from difflib import get_close_matches
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from types import MappingProxyType

from hmtb_twin.arm_files.model_file import ENDINGS
from hmtb_twin.files.errors import TwinError, shown
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.arm_toml import FILE_NAME, ArmSettings, read_arm_toml
from hmtb_twin.parameters.chain_arm import MODEL, chain_arm
from hmtb_twin.parameters.resources import model_file, models_directory
from hmtb_twin.parameters.variants import JOINTS, LINKS, VARIANTS

EXAMPLES = ("panda", "ur10", "xarm7", "kinova")
"""Arms that are named where a name is like none."""

COLLECTION = "example-robot-data"
"""The package whose robots are known by name."""


def arm_named(name: str) -> ArmDescription:
    """Return an arm by name, or from a file or folder.

    Args:
        name: One of the arms of the test bed, of `models` or of example-robot-data; else the path of an MJCF, a URDF,
            or a folder with one of them or an `arm.toml`.

    Raises:
        TwinError: There is no such arm, or its files are wrong.
    """
    if isinstance(name, str) and name in VARIANTS:
        return VARIANTS[name]
    place = _place(name)
    if place is None:
        others = [arm for arm in arm_names() if arm not in VARIANTS]
        near = ", ".join(get_close_matches(str(name), others) or EXAMPLES)
        raise TwinError(
            f"unknown variant {shown(name)}, available: {', '.join(VARIANTS)}; one of {len(others)} other arms, as "
            f"{near}; or the path of an MJCF, a URDF or a folder"
        )
    return _read(name, *_files(place))


def arm_names() -> tuple[str, ...]:
    """Names of all arms that are known: of the test bed first."""
    return (*VARIANTS, *_known_places())


def _place(name: object) -> Path | None:
    """Where the files of an arm are; None for a name that is neither known nor a path, with a slash or an ending."""
    if not isinstance(name, str) or not name:
        return None
    is_path = "/" in name or name.endswith((*ENDINGS, ".toml")) or Path(name).is_dir()
    return _known_places().get(name, Path(name) if is_path else None)


@cache
def _known_places() -> Mapping[str, Path]:
    """Folders of `models` and files of example-robot-data by name."""
    places = {file.parent.name: file.parent for file in sorted(models_directory().glob(f"*/{FILE_NAME}"))}
    robots = robots_folder()
    if robots is not None:
        for file in sorted(robots.rglob("*.urdf")):
            # The name that a user would type: the file's own, which says more than its folder.
            name = file.stem.removesuffix("_robot")
            places.setdefault(file.stem if name in places else name, file)
    return MappingProxyType({name: place for name, place in places.items() if name not in VARIANTS})


@cache
def robots_folder() -> Path | None:
    """Folder of the robots of example-robot-data; None where the package is not installed."""
    try:
        files = distribution(COLLECTION).files or []
    except PackageNotFoundError:
        return None
    for file in files:
        parts = file.parts
        if "robots" in parts and COLLECTION in parts:
            folder = Path(str(file.locate()))
            return folder.parents[len(parts) - parts.index("robots") - 2]
    return None


def _files(place: Path) -> tuple[Path, Path | None]:
    """Model file and settings file, if there is one, of a place: a model, a settings file, or a folder of them."""
    # A file alone has no settings: those of its folder may be of another one.
    if place.is_file() and place.name.endswith(ENDINGS):
        return place, None
    toml = place if place.name.endswith(".toml") else place / FILE_NAME
    if toml.is_file():
        settings = read_arm_toml(toml)
        # Settings may stand alone, and name a model that comes with a package.
        if settings.model:
            return _model_of(toml, settings.model), toml
        return _only_model(toml.parent), toml
    if place.is_dir():
        return _only_model(place), None
    raise TwinError(f"no arm at {str(place)!r}: expected an MJCF, a URDF, or a folder with one of them")


def _model_of(toml: Path, name: str) -> Path:
    """The model file that settings name: beside them, or in example-robot-data."""
    prefix = f"{COLLECTION}:"
    if name.startswith(prefix):
        robots = robots_folder()
        if robots is None:
            raise TwinError(f"{toml.name}: model {shown(name)} given, but {COLLECTION} is not installed")
        folder, path = robots, robots / name.removeprefix(prefix)
    else:
        folder, path = toml.parent, toml.parent / name
    if not path.resolve().is_relative_to(folder.resolve()):
        raise TwinError(f"{toml.name}: model {shown(name)} given, expected a file in the folder or below")
    if not path.is_file():
        raise TwinError(f"{toml.name}: there is no model file {shown(name)}")
    return path


def _only_model(folder: Path) -> Path:
    """The model file of a folder: its only one, or that of its name; a scene includes another one."""
    candidates = sorted(file for file in folder.iterdir() if file.suffix in ENDINGS and file.is_file())
    models = [file for file in candidates if "scene" not in file.stem] or candidates
    named = [file for file in models if file.stem in (folder.name, *folder.name.split("_"))]
    # As menagerie has it: `franka_emika_panda/panda.xml` beside `hand.xml` and `scene.xml`.
    if len(named) == 1:
        return named[0]
    if len(models) != 1:
        listed = ", ".join(file.name for file in models) or "none"
        raise TwinError(f"folder {folder.name}: model files {listed} given, expected one, or its name in {FILE_NAME}")
    return models[0]


def _read(name: str, model: Path, toml: Path | None) -> ArmDescription:
    """Read an arm again only where its files have changed."""
    stamps = []
    for file in (model, toml):
        if file is not None:
            # A file that is written again within the clock's resolution mostly has another size.
            stamps += [file.stat().st_mtime_ns, file.stat().st_size]
    return _cached(name, model.resolve(), None if toml is None else toml.resolve(), tuple(stamps))


@lru_cache(maxsize=32)
def _cached(name: str, model: Path, toml: Path | None, stamps: tuple[int, ...]) -> ArmDescription:
    # MuJoCo, Pinocchio and SciPy take a second to load: arms of the test bed do without.
    from hmtb_twin.arm_files.described_arm import described_arm

    settings = ArmSettings() if toml is None else read_arm_toml(toml)
    try:
        return _changed_test_bed(name, model, settings) if settings.link else described_arm(name, model, settings)
    except TwinError as error:
        where = f"{toml.parent.name}/{toml.name}: " if toml is not None and not str(error).startswith(toml.name) else ""
        raise TwinError(f"{where}{error}") from error


def _changed_test_bed(name: str, model: Path, settings: ArmSettings) -> ArmDescription:
    """An arm of the test bed's chain with numbers of its own: links, drives, servos, payloads, poses, bus."""
    chain = model_file(f"hmtb/{MODEL}")
    if model.read_bytes() != chain.read_bytes():
        raise TwinError(
            f"links given, but {model.name} is not the {MODEL} of the test bed whose links they are; expected its "
            "copy, or no [link], and the file is read as any other one"
        )
    # The closed form of the tool's kinematics, the worksite and the pictures are of this chain alone.
    arm = chain_arm(name, settings)
    if arm.joints != JOINTS:
        raise TwinError(f"joints {', '.join(arm.joints)} given, expected those of {MODEL}: {', '.join(JOINTS)}")
    for body, link in (arm.links or {}).items():
        if link.length != LINKS[body].length:
            raise TwinError(
                f"link.{body}.length = {link.length:g} m given, expected {LINKS[body].length:g}: joints and axes are "
                f"those of {MODEL}. A chain of other lengths is an MJCF of its own, without [link]"
            )
    return arm
