"""tools/prove.py says so when a module is not safe: a decoder that writes one byte too far, an encoder whose room is
a byte short, a function that breaks the contract that others rely on."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ROOT


def prove(top: Path, name: str = "link") -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(top / "tools" / "prove.py"), name]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def copy(top: Path, *names: str) -> None:
    """These files and folders of the repository, what proves them, and the contracts."""
    for name in ("firmware/include", "tests/proofs", "tools/prove.py", "tools/kept.py", *names):
        (top / name).parent.mkdir(parents=True, exist_ok=True)
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, top / name)
        else:
            shutil.copy(ROOT / name, top / name)


def change(place: Path, old: str, new: str) -> None:
    text = place.read_text(encoding="utf-8")
    assert old in text
    place.write_text(text.replace(old, new), encoding="utf-8")


def test_byte_too_far_is_an_alarm(tmp_path: Path) -> None:
    copy(tmp_path, "firmware/link", "firmware/src/persist/crc32.c")
    assert prove(tmp_path).returncode == 0
    assert "since then nothing has changed" in prove(tmp_path).stdout
    link = tmp_path / "firmware" / "link" / "link.c"
    change(link, "if (self->filled == sizeof self->raw) {", "if (self->filled > sizeof self->raw) {")
    done = prove(tmp_path)
    assert done.returncode == 1
    assert "link.c" in done.stdout and "out of bounds index" in done.stdout


@pytest.mark.long
def test_room_that_is_a_byte_short_is_not_proved(tmp_path: Path) -> None:
    copy(tmp_path, "firmware/link", "firmware/src/persist/crc32.c")
    room = "(PVID_LINK_RAW_BYTES(n) / 254u) + "
    change(tmp_path / "firmware" / "link" / "link.h", f"{room}2u)", f"{room}1u)")
    done = prove(tmp_path, "encoder")
    assert done.returncode == 1
    assert "Goal typed_pvid_link_encode_call_stuff" in done.stdout


def test_a_contract_that_is_not_kept_is_an_alarm(tmp_path: Path) -> None:
    copy(tmp_path, "firmware/src")
    change(tmp_path / "firmware" / "src" / "number" / "scaled_q31.c", "#define DIGITS 30\n", "#define DIGITS 31\n")
    done = prove(tmp_path, "scaled_of_q31")
    assert done.returncode == 1
    assert "function pvid_scaled_of_q31: postcondition got status invalid" in done.stdout
