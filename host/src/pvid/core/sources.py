"""Sources and header folders of the C core, for compilers that are called without CMake."""

from __future__ import annotations

from pathlib import Path

from pvid.models.registry import DEFAULT

ROOT = Path(__file__).resolve().parents[4]
FIRMWARE = ROOT / "firmware"
SRC = FIRMWARE / "src"
MODEL = FIRMWARE / "models" / DEFAULT  # the one that the library is built with
PUBLIC_FOLDERS = (FIRMWARE / "include", MODEL / "include")
FOLDERS = (*PUBLIC_FOLDERS, SRC, MODEL)
PUBLIC_INCLUDES = [f"-I{folder}" for folder in PUBLIC_FOLDERS]
INCLUDES = [f"-I{folder}" for folder in FOLDERS]
_CORES = ("_f32", "_q31")


def core_sources(pattern: str = "*.c") -> list[Path]:
    """Sources of all rooms and of the mechanism whose names match `pattern`, sorted by name."""
    return sorted([*SRC.glob(f"*/{pattern}"), *MODEL.glob(pattern)], key=lambda path: path.name)


def sources_of(core: str) -> list[Path]:
    """The sources of one core, f32 or q31, and those that both need."""
    return [path for path in core_sources() if not path.stem.endswith(_CORES) or path.stem.endswith(f"_{core}")]


def source(name: str) -> Path:
    """The source of this name."""
    (found,) = core_sources(name)
    return found


def public_headers() -> list[Path]:
    """Headers that an application includes as pvid/NAME.h."""
    return sorted(path for folder in PUBLIC_FOLDERS for path in folder.glob("pvid/**/*.h"))
