"""tools/prove.py says so when a module is not safe: a decoder that writes one byte too far, an encoder whose room is
a byte short, a function that breaks the contract that others rely on."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def prove(top: Path, name: str = "link") -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(top / "tools" / "prove.py"), name]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def copy_link(tmp_path: Path) -> None:
    for name in ("firmware/include", "firmware/link", "tests/proofs"):
        shutil.copytree(ROOT / name, tmp_path / name)
    for name in ("tools/prove.py", "firmware/src/crc32.c"):
        (tmp_path / name).parent.mkdir(parents=True)
        shutil.copy(ROOT / name, tmp_path / name)


def test_byte_too_far_is_an_alarm(tmp_path: Path) -> None:
    copy_link(tmp_path)
    assert prove(tmp_path).returncode == 0
    link = tmp_path / "firmware" / "link" / "link.c"
    text = link.read_text(encoding="utf-8")
    assert "if (self->filled == sizeof self->raw) {" in text
    text = text.replace("if (self->filled == sizeof self->raw) {", "if (self->filled > sizeof self->raw) {")
    link.write_text(text, encoding="utf-8")
    done = prove(tmp_path)
    assert done.returncode == 1
    assert "link.c" in done.stdout and "out of bounds index" in done.stdout


def test_room_that_is_a_byte_short_is_not_proved(tmp_path: Path) -> None:
    copy_link(tmp_path)
    header = tmp_path / "firmware" / "link" / "link.h"
    text = header.read_text(encoding="utf-8")
    assert "(PVID_LINK_RAW_BYTES(n) / 254u) + 2u)" in text
    text = text.replace("(PVID_LINK_RAW_BYTES(n) / 254u) + 2u)", "(PVID_LINK_RAW_BYTES(n) / 254u) + 1u)")
    header.write_text(text, encoding="utf-8")
    done = prove(tmp_path, "encoder")
    assert done.returncode == 1
    assert "Goal typed_pvid_link_encode_call_stuff" in done.stdout


def test_a_contract_that_is_not_kept_is_an_alarm(tmp_path: Path) -> None:
    for name in ("firmware/include", "firmware/src", "tests/proofs"):
        shutil.copytree(ROOT / name, tmp_path / name)
    (tmp_path / "tools").mkdir()
    shutil.copy(ROOT / "tools" / "prove.py", tmp_path / "tools")
    scaled = tmp_path / "firmware" / "src" / "scaled_q31.c"
    text = scaled.read_text(encoding="utf-8")
    assert "#define DIGITS 30\n" in text
    scaled.write_text(text.replace("#define DIGITS 30\n", "#define DIGITS 31\n"), encoding="utf-8")
    done = prove(tmp_path, "scaled_of_q31")
    assert done.returncode == 1
    assert "function pvid_scaled_of_q31: postcondition got status invalid" in done.stdout
