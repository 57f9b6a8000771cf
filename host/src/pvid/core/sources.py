"""Sources and header folders of the C core, for compilers that are called without CMake."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from pvid.base.atomic_write import write_whole
from pvid.base.user_cache import built_under, user_cache

PACKAGE = Path(__file__).resolve().parents[1]
_IN_WHEEL = PACKAGE / "sources"
IS_CLONE = not _IN_WHEEL.is_dir()
ROOT = PACKAGE.parents[2] if IS_CLONE else _IN_WHEEL
FIRMWARE = ROOT / "firmware"
SRC = FIRMWARE / "src"
REFINE_MODEL = FIRMWARE / "examples" / "refine_model"  # the second stage that the library is built with
PUBLIC_FOLDERS = (FIRMWARE / "include", REFINE_MODEL)
FOLDERS = (*PUBLIC_FOLDERS, SRC)
PUBLIC_INCLUDES = [f"-I{folder}" for folder in PUBLIC_FOLDERS]
INCLUDES = [f"-I{folder}" for folder in FOLDERS]
_CORES = ("_f32", "_q31")
_FORMS = ("strong", "weak", "robot", "refine", "excite")  # rooms that not every image links


def build_folder() -> Path:
    """Where something may be built: build/ of the clone, or the user's cache."""
    return built_under(ROOT / "build") if IS_CLONE else built_under(Path("/nonexistent"))


def cache_folder() -> Path:
    """What is kept under all that it was made from: the user's cache, which clones share, else that of builds."""
    return (user_cache() or build_folder()) / "cache"


def kept_text(place: Path) -> str:
    """A text of the cache; "" where there is none."""
    with suppress(OSError):
        return place.read_text(encoding="utf-8")
    return ""


def keep_text(place: Path, text: str) -> None:
    """Keeps a text in the cache, where this user may write there."""
    with suppress(OSError):
        place.parent.mkdir(parents=True, exist_ok=True)
        write_whole(place, text, freely=True)


def core_sources(pattern: str = "*.c") -> list[Path]:
    """Sources of all rooms whose names match `pattern`, sorted by name."""
    return sorted(SRC.glob(f"*/{pattern}"), key=lambda path: path.name)


def sources_of(core: str) -> list[Path]:
    """The sources of one core, f32 or q31, and those that both need."""
    return [path for path in core_sources() if not path.stem.endswith(_CORES) or path.stem.endswith(f"_{core}")]


def left_out(form: str, core: str, *also: str) -> str:
    """PVID_LEAVE_OUT of an image with a form's identifier: a regular expression of what it does not link.

    `also`: further rooms that it links.
    """
    rooms = "|".join(room for room in _FORMS if room not in (form, *also))
    cores = "|".join(other for other in _CORES if other != f"_{core}")
    return rf"/src/({rooms})/|[/_]({rooms})_[^/]*\.c$|({cores})\.c$"


def source(name: str) -> Path:
    """The source of this name."""
    (found,) = core_sources(name)
    return found


def public_headers() -> list[Path]:
    """Headers that an application includes as pvid/NAME.h."""
    return sorted(path for folder in PUBLIC_FOLDERS for path in folder.glob("pvid/**/*.h"))
