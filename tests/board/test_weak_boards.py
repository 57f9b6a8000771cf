"""The weak form of a mechanism on emulated boards, in either arithmetic: the hash of the core here."""

import json
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import PATIENCE_S
from program import pvid
from records import MECHANISM, Writer, load

from bench.kinds import KINDS
from pvid.base.errors import PvidError
from pvid.board import mechanism_image, mechanism_image_q31
from pvid.board.boards import BOARDS
from pvid.board.mechanism_image import MISSING, build_mechanism_image, header, mechanism_run, native_hashes
from pvid.board.replay_image import REPORT_EVERY, play
from pvid.codegen.fitted_sizes import fitted_sizes
from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.core.native import Publisher
from pvid.settings.enums import Core, RecordStatus
from pvid.twin.fnv import fold_bytes

TICKS = 2500


def _long(board: str, name: str, core: str) -> Any:
    return pytest.param(board, name, core, marks=pytest.mark.long)


@pytest.mark.parametrize(
    ("board", "name", "core"),
    [
        ("mps2-an386", "cart_pendulum", "f32"),
        ("virt-rv32imac", "battery_2rc", "q31"),  # the pendulum: test_targets.py
        ("microbit", "dc_motor", "q31"),  # its short products have less room than those of other cores
        *(_long(board, "battery_2rc", "f32") for board in ("virt-rv32imac", "microbit")),  # soft float
        *(_long(board, "two_link_arm", "f32") for board in ("mps3-an547", "virt-rv32imafc")),
        *(_long("mps2-an386", name, "f32") for name in KINDS if name != "cart_pendulum"),
        *(_long("mps2-an386", name, "q31") for name in KINDS),
    ],
)
def test_a_board_computes_the_bits_of_the_core_here(board: str, name: str, core: str) -> None:
    if core == "f32":
        run = mechanism_run(name)
        expected = native_hashes(run)
        image, _ = build_mechanism_image(BOARDS[board], run)
    else:
        fixed = mechanism_image_q31.fixed_run(name)
        expected = mechanism_image_q31.native_hashes(fixed)
        image, _ = mechanism_image_q31.build_fixed_image(BOARDS[board], fixed)
    report = play(BOARDS[board], image, PATIENCE_S)
    assert report.ticks == len(expected)
    assert {at: int(expected[at - 1]) for at in report.hashes} == report.hashes
    assert len(report.hashes) == len(expected) // REPORT_EVERY
    assert report.hash == int(expected[-1])
    assert report.instructions_mean > 0


LIFE = """\
/* A record piece by piece at every tick; the first complete one is the start of the next life. */
static uint32_t replay_life(uint32_t hash, pvid_weak_@core@ *self, pvid_reason reason)
{
    static pvid_record_writer writer;
    static uint8_t record[PVID_RECORD_BYTES(PVID_MAX_P)];
    static bool second;
    uint32_t next = pvid_fnv_estimator_@core@(hash, &self->estimator, reason);
    if (!second) {
        const pvid_record_status saved =
            pvid_record_save_weak_@core@(self, &writer, MECHANISMu, record, sizeof record);
        next = pvid_fnv_word(next, (uint32_t)saved);
        if (saved == PVID_RECORD_DONE) {
            second = pvid_record_load_weak_@core@(self, &replay_config, MECHANISMu, record, sizeof record) ==
                     PVID_RECORD_DONE;
            next = pvid_fnv_word(next, pvid_crc32(0u, record, PVID_RECORD_BYTES(PVID_MAX_P)));
        }
    }
    return next;
}
#undef REPLAY_HASH
#define REPLAY_HASH(hash, estimator, reason) replay_life(hash, &identifier, reason)

#endif
"""


def hash_of_two_lives(core: Publisher, arithmetic: str, samples: Any, n_p: int) -> tuple[int, int]:
    """What LIFE computes on a board, and the tick of the second life."""
    writer, second = Writer(core, arithmetic, n_p), 0
    for tick, sample in enumerate(samples):
        core.run_samples(sample[np.newaxis])  # type: ignore[attr-defined]
        if not second:
            status = writer.piece()
            words = [int(status)]
            if status is RecordStatus.DONE:
                assert load(core, arithmetic, writer.record) is RecordStatus.DONE
                second = tick
                words.append(zlib.crc32(writer.record))
            for word in words:
                core.running_hash = fold_bytes(core.running_hash, word.to_bytes(4, "little"))
    return core.running_hash, second


@pytest.mark.parametrize(("board", "core"), [("mps2-an386", "f32"), ("microbit", "q31")])
def test_a_record_and_the_life_after_it_have_the_bits_of_this_computer(board: str, core: Core) -> None:
    ticks = 16 * 320 * (1 if core == "f32" else 2)
    header = "pvid/record_weak.h" if core == "f32" else "pvid/record_weak_q31.h"
    life = "".join(f'#include "{one}"\n' for one in (header, "pvid/crc32.h")) + LIFE.replace("@core@", core)
    life = life.replace("MECHANISM", hex(MECHANISM))
    if core == "f32":
        run = mechanism_run("dc_motor", ticks)
        files, sizes = mechanism_image.files_of(run), fitted_sizes(run.config)
        native = weak_native(run.compiled, run.config.design).identifier_of(run.config)
        expected, second = hash_of_two_lives(native, core, run.samples, len(run.compiled.unknowns))
    else:
        fixed = mechanism_image_q31.fixed_run("dc_motor", ticks)
        weak = fixed.weak
        files, sizes = mechanism_image_q31.files_of(fixed), fixed.sizes
        native_q31 = weak_native_q31(weak.made, weak.parameters, weak.config).identifier()
        expected, second = hash_of_two_lives(native_q31, core, fixed.counts, len(weak.compiled.unknowns))
    assert 0 < second < ticks - 2 * 320
    files["replay_run.h"] = files["replay_run.h"].rstrip().removesuffix("#endif") + life
    image, _ = mechanism_image.build_with(BOARDS[board], f"dc_motor-record-{core}", files, sizes, core)
    assert play(BOARDS[board], image, PATIENCE_S).hash == expected


def test_an_avr_is_refused_in_words() -> None:
    with pytest.raises(PvidError, match="float32 has no bits of the twin on an AVR"):
        build_mechanism_image(BOARDS["atmega2560"], mechanism_run("kapitza", TICKS))


def test_a_sample_is_a_count_times_its_resolution() -> None:
    run = mechanism_run("kapitza", TICKS)
    assert (run.counts != MISSING).all()
    text = header(run)
    rows = re.findall(r"^    \{(-?\d+), (-?\d+)\},$", text, re.MULTILINE)
    assert len(rows) == TICKS
    assert [int(one) for one in rows[7]] == run.counts[7].tolist()


def test_sizes_of_a_mechanism_are_written_as_json(tmp_path: Path) -> None:
    outcome = pvid(tmp_path, "sizes", "--json", "mps2-an386", "--model", "cart_pendulum")
    assert outcome.returncode == 0, outcome.stderr
    (found,) = json.loads(outcome.stdout)
    assert {key: found[key] for key in ("target", "model", "form", "core")} == {
        "target": "mps2-an386",
        "model": "cart_pendulum",
        "form": "weak",
        "core": "f32",
    }
    assert all(found[key] > 0 for key in ("text", "tables", "state", "stack_bound", "mean", "longest"))
    assert found["longest"] >= found["mean"]
