"""The image behind the serial link (firmware/apps/stream) for a rig: its settings and tables, and the build."""

from __future__ import annotations

import re
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from pvid.board.boards import BUILD, Board, build, keep_header, one_at_a_time
from pvid.board.stream_rig import StreamRig
from pvid.core.host_compiler import host_compiler, objects_of, run_compiler
from pvid.core.model_library import core_options, of_second_stage
from pvid.core.sizes import options_of, roomy
from pvid.core.sources import FIRMWARE, core_sources, left_out
from pvid.design.c_tables import float_literal
from pvid.link.frames import Configuration, Source
from pvid.link.names import names_of
from pvid.models.registry import DEFAULT, MODELS
from pvid.settings.enums import Core
from pvid.twin.sensor import SensorConstants

HOST = "host"


def _tables(rig: StreamRig) -> str:
    """stream_tables.h: `stream_config`, without what Configure brings, and what it points to."""
    return rig.case.header(rig.case.shared(rig.config), rig.l1, "stream_config", "pvid.board.stream_image")


def _macros(rig: StreamRig) -> list[str]:
    """stream_rig.h but for the number of it all."""
    units = ", ".join(float_literal(np.float32(unit)) for unit in rig.p_unit[: len(MODELS[DEFAULT].parameters)])
    form, core = rig.case.form, rig.case.core
    sensor = SensorConstants.standard(rig.l1, rig.sample_rate, rig.phi_lsb, rig.y_lsb)
    return [
        f"#define STREAM_CORE {int(rig.core)}",
        f"#define STREAM_FORM {int(rig.form)}",
        f"#define STREAM_TYPE pvid_{form}_{core}",
        f"#define STREAM_CONFIG pvid_{form}_config_{core}",
        f"#define STREAM_INIT pvid_{form}_init_{core}",
        f"#define STREAM_STEP pvid_{form}_step_{core}",
        f"#define STREAM_N_P {rig.n_p}u",
        f"#define STREAM_SAMPLE_RATE {float_literal(np.float32(rig.sample_rate))}",
        f"#define STREAM_PHI_LSB {float_literal(np.float32(rig.phi_lsb))}",
        f"#define STREAM_Y_LSB {float_literal(np.float32(rig.y_lsb))}",
        f"#define STREAM_P_UNIT {{{units}}}",
        f"#define STREAM_SENSOR_CONSTANTS {sensor.c_initializer}",
    ]


def _described(rig: StreamRig) -> list[str]:
    """What follows from the rest, or no bit depends on, and is not in the number."""
    model = MODELS[DEFAULT]
    assess, assessed = rig.case.assess_call
    return [
        f"#define STREAM_HASH {rig.case.hash_function}",
        f"#define STREAM_ASSESS {assess}",
        f"#define STREAM_ASSESSED {assessed}",
        f"#define STREAM_SAMPLES {len(model.channels)}u",
        "#define STREAM_PHI 0u",
        "#define STREAM_Y 1u",
        f"#define STREAM_NAMES {c_string(names_of(model).text)}",
    ]


def c_string(text: str) -> str:
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
    form : weak, strong, or weak for the engine of any mechanism
    core : arithmetic
    identifier : firmware/apps/stream/identifier_<identifier>.c
    sensor : a file of firmware/apps/stream
    sizes : PVID_MAX_ macro -> value
    refined : with the second stage, whose refine_model_f32.h and pvid/refine_shape.h are among the files
    """

    number: int
    macros: list[str]
    files: dict[str, str]
    form: str
    core: Core
    identifier: str
    sensor: str
    sizes: dict[str, str]
    refined: bool = False

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
    """What else than a StreamRig an image can be made for."""

    @property
    def stream_image(self) -> StreamImage: ...

    def configure(
        self, settings: int, hash_every: int, estimate_every: int, source: Source = ..., first_tick: int = ...
    ) -> Configuration: ...


def image_of(rig: StreamRig | Streamed) -> StreamImage:
    """What its image is compiled from."""
    if not isinstance(rig, StreamRig):
        return rig.stream_image
    return StreamImage(
        number=settings_number(rig),
        macros=[*_macros(rig), *_described(rig)],
        files={"stream_tables.h": _tables(rig)},
        form=rig.case.form,
        core=rig.case.core,
        identifier=rig.case.core,
        sensor="sensor.c",
        sizes=rig.case.sizes(rig.config),
    )


def settings_number(rig: StreamRig | Streamed) -> int:
    """CRC-32 of the settings and tables an image must hold to be configured for `rig`."""
    if not isinstance(rig, StreamRig):
        return rig.stream_image.number
    return zlib.crc32("\n".join([*_macros(rig), _tables(rig)]).encode())


def _guarded(guard: str, lines: list[str]) -> str:
    banner = "/* Generated by pvid.board.stream_image: do not edit. */"
    return "\n".join([banner, f"#ifndef {guard}", f"#define {guard}", "", *lines, "", "#endif", ""])


def build_image(rig: StreamRig | Streamed, board: Board | None) -> Path:
    """Builds the stream image for a board, or for this machine (None), under build/targets; returns it.

    Raises
    ------
    PvidError
        When a compiler is missing or something does not build.
    """
    image = image_of(rig)
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
    options["PVID_STREAM_SENSOR"] = image.sensor
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
        *(application / file for file in ("main.c", "answers.c", made.sensor, f"identifier_{made.identifier}.c")),
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
