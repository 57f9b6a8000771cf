"""The image behind the serial link (firmware/apps/stream) for a rig: its settings and tables, and the build."""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from pvid.base.errors import PvidError
from pvid.board.boards import BUILD, Board, build, keep_header, one_at_a_time
from pvid.core.host_compiler import host_compiler, objects_of, run_compiler
from pvid.core.model_library import core_options, of_second_stage
from pvid.core.sizes import options_of, raised, roomy
from pvid.core.sources import FIRMWARE, SRC, core_sources, left_out
from pvid.design.c_tables import float_literal
from pvid.link import frames
from pvid.link.frames import Configuration, Source
from pvid.link.names import BoardNames
from pvid.settings.enums import Core, Form

HOST = "host"
SLOWEST = 1.0  # ticks a second: the image counts the time between two samples in 32 bits of nanoseconds
MOST_TICKS = 40_000  # of a simulation that an image contains


def refuse_slow(sample_rate: float) -> None:
    """PvidError for a rate that an image cannot count."""
    if not sample_rate >= SLOWEST:
        raise PvidError(f"the sample rate is {sample_rate:g} Hz, and a board streams at 1 Hz and more")


def _c_string(text: str) -> str:
    """A literal of C."""
    return '"' + text.replace("\n", "\\n") + '"'


@dataclass(frozen=True)
class StreamImage:
    """What an image is compiled from, beside the core.

    Attributes
    ----------
    number : CRC-32 of all that the bits depend on
    macros : lines of stream_rig.h
    files : generated headers and sources by name
    form : weak or strong
    core : arithmetic
    sizes : PVID_MAX_ macro -> value
    refined : with the second stage, whose refine_model_f32.h and pvid/refine_shape.h are among the files
    """

    number: int
    macros: list[str]
    files: dict[str, str]
    form: Form
    core: Core
    sizes: dict[str, str]
    refined: bool = False

    @classmethod
    def made(
        cls,
        form: Form,
        core: Core,
        *,
        own: Sequence[str],
        names: BoardNames,
        sample_rate: float,
        units: Sequence[str],
        code: Mapping[str, str],
        recording: str,
        sizes: Mapping[str, int],
        refined: bool = False,
        more: Sequence[str] = (),
    ) -> StreamImage:
        """What a board of either form and arithmetic has in common.

        Parameters
        ----------
        own : lines of stream_rig.h that name the identifier's types and configuration
        units : of the parameters in a frame, as C
        code : generated headers and sources, stream_tables.h among them
        recording : stream_recording.h
        more : further lines of stream_rig.h
        """
        samples = len(names.samples)
        macros = [  # logs contain the number: lines that nothing reads any more stay, and their order
            f"#define STREAM_CORE {int(frames.Core[core.upper()])}",
            f"#define STREAM_FORM {int(frames.Form[form.upper()])}",
            *own,
            f"#define STREAM_N_P {len(names.parameters)}u",
            f"#define STREAM_SAMPLES {samples}u",
            f"#define STREAM_SAMPLE_RATE {float_literal(np.float32(sample_rate))}",
            *[f"#define {one} 0.0f" for one in ("STREAM_PHI_LSB", "STREAM_Y_LSB")],
            f"#define STREAM_LSB {{{', '.join(['0.0f'] * samples)}}}",
            f"#define STREAM_P_UNIT {{{', '.join(units)}}}",
            f"#define STREAM_NAMES {_c_string(names.text)}",
            *more,
        ]
        number = zlib.crc32("\n".join([*macros, *code.values()]).encode())
        files = {**code, "stream_recording.h": recording}
        return cls(
            number, macros, files, form, core, {name: str(size) for name, size in raised(sizes).items()}, refined
        )

    @property
    def identifier(self) -> str:
        """firmware/apps/stream/identifier_<this>.c."""
        return f"{self.form}_{self.core}"

    @property
    def headers(self) -> dict[str, str]:
        """All files, stream_rig.h among them."""
        told = f"#define STREAM_SETTINGS 0x{self.number:08X}u /* CRC-32 of what the bits depend on */"
        return {"stream_rig.h": _guarded("STREAM_RIG_H", [told, *self.macros]), **self.files}

    @property
    def left_out(self) -> str:
        """What of the core is not linked."""
        return left_out(self.form, self.core, *(["refine"] if self.refined else []))


class Streamed(Protocol):
    """What an image can be made for."""

    @property
    def stream_image(self) -> StreamImage: ...

    def configure(
        self, settings: int, hash_every: int, estimate_every: int, source: Source = ..., first_tick: int = ...
    ) -> Configuration: ...


def settings_number(rig: Streamed) -> int:
    """CRC-32 of the settings and tables an image must hold to be configured for `rig`."""
    return rig.stream_image.number


def _guarded(guard: str, lines: list[str]) -> str:
    banner = "/* Generated by pvid.board.stream_image: do not edit. */"
    return "\n".join([banner, f"#ifndef {guard}", f"#define {guard}", "", *lines, "", "#endif", ""])


def build_image(rig: Streamed, board: Board | None) -> Path:
    """Builds the stream image for a board, or for this machine (None), under build/targets; returns it.

    Raises PvidError when a compiler is missing or something does not build.
    """
    image = rig.stream_image
    files = image.headers
    name = f"stream-{zlib.crc32(repr(sorted(files.items())).encode()):08x}"
    folder = BUILD / "runs" / name
    for file, text in files.items():
        keep_header((folder / file).parent, Path(file).name, text)
    if board is None:
        tree = BUILD / f"{HOST}-{name}"
        with one_at_a_time(tree):
            return _build_for_host(image, folder, tree)
    options = {"PVID_STREAM_RIG": str(folder), "PVID_STREAM_CORE": image.identifier, **image.sizes}
    options["PVID_LEAVE_OUT"] = image.left_out
    if image.refined:
        options["PVID_REFINE_MODEL"] = str(folder)
    tree = build(board, BUILD / f"{board.name}-{name}", options)
    return tree / "apps" / "stream" / "stream.elf"


def _build_for_host(made: StreamImage, folder: Path, tree: Path) -> Path:
    """Compiled like a mechanism's library (pvid.core.model_library); without what it does not link. This computer has
    the memory for larger arrays than needed, with which most images are linked from the same objects."""
    application = FIRMWARE / "apps" / "stream"
    needless = re.compile(made.left_out)
    core = [path for path in core_sources() if not needless.search(path.as_posix())]
    sources = [
        FIRMWARE / "link" / "link.c",
        FIRMWARE / "ports" / "host" / "port.c",
        FIRMWARE / "ports" / "host" / "receiver.c",
        *(
            application / file
            for file in ("main.c", "answers.c", "sensor_recording.c", f"identifier_{made.identifier}.c")
        ),
        *(folder / name for name in sorted(made.files) if name.endswith(".c")),
    ]
    image = tree / "stream"
    inputs = [*core, *sources, *folder.glob("**/*.h"), *FIRMWARE.glob("**/*.h")]
    if image.exists() and image.stat().st_mtime > max(one.stat().st_mtime for one in inputs):
        return image
    compiler = host_compiler("a board that this computer plays")
    sizes = roomy({name: int(value) for name, value in made.sizes.items()})
    options = core_options(options_of(sizes))
    tree.mkdir(parents=True, exist_ok=True)
    rig = tree / "rig"  # by the same name in every tree, so that ccache finds the objects of another without reading
    if not rig.is_symlink():
        rig.symlink_to(folder)
    own = [
        f"-I{rig.name}",
        f"-I{SRC}",  # a printed strong form includes its identifier from there
        *options,
        *(f"-I{FIRMWARE / one}" for one in ("link", "ports")),
        f'-DPVID_BOARD_NAME="{HOST}"',
    ]
    # The core is the same of every rig with these sizes, but for the second stage, whose shape is the rig's.
    objects = objects_of(compiler, options, [one for one in core if not of_second_stage(one)], tree)
    objects += objects_of(compiler, own, [*filter(of_second_stage, core), *sources], tree)
    fresh = tree / "stream.new"
    run_compiler([compiler, *objects, "-lm", "-o", str(fresh)])
    fresh.replace(image)
    return image
