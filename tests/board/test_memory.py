"""Memory and arithmetic of the C core, checked at every access while it runs: the library that Python loads, and the
program that runs behind the serial link. (tools/test does the same with the CMocka programs.)

The library and one build of the program are clang's with its address, undefined-behaviour and integer sanitizers; no
unsigned number may wrap but where tests/sanitizers.ignore says so. The program as it is built otherwise runs under
valgrind, which sees the use of what was never written.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from test_stream import KINDS, Faulty, expected, play_standard, standard_rig

from pvid.board import stream_image, target
from pvid.board.boards import one_at_a_time
from pvid.board.target import HOST_TARGET, Verdict, judge, open_target
from pvid.core.native import Native
from pvid.core.sources import ROOT

TREE = ROOT / "build" / "native-sanitized"
PLAYER = Path(__file__).with_name("hostile_runs.py")
SANITIZERS = (
    "-fsanitize=address,undefined,float-cast-overflow,integer -fno-sanitize-recover=all"
    f" '-fsanitize-ignorelist={ROOT / 'tests' / 'sanitizers.ignore'}'"
)
# It would outlive the program and hold its output open; addr2line turns what is printed into lines.
NO_SYMBOLIZER = "symbolize=0"


def run(*command: object, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(part) for part in command], env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def library() -> Path:
    """libpvid_native.so with the sanitizers."""
    flags = f"-shared-libasan -Wno-pass-failed {SANITIZERS} -g"
    options = ["-DCMAKE_C_COMPILER=clang", f"-DCMAKE_C_FLAGS={flags}", "-DPVID_BUILD_TESTS=OFF"]
    options += ["-DCMAKE_BUILD_TYPE=RelWithDebInfo", "-DCMAKE_C_FLAGS_RELWITHDEBINFO=-O0 -g"]
    with one_at_a_time(TREE):
        configure = ("cmake", "-S", ROOT, "-B", TREE, "-G", "Ninja", *options)
        for command in (configure, ("ninja", "-C", TREE, "pvid_native")):
            done = run(*command)
            assert done.returncode == 0, done.stdout + done.stderr
    return TREE / "host" / "native" / "libpvid_native.so"


@pytest.fixture
def compiler() -> Path:
    """The same for the weak core, whose functions of a mechanism are generated. It has a place and a time of its own:
    what it has compiled is found again (20 s of 29)."""
    made = TREE / "clang-sanitized"
    text = f'#!/bin/sh\nunset LD_PRELOAD\nexec clang -shared-libasan -Wno-pass-failed {SANITIZERS} -g "$@" -O0\n'
    if not made.exists() or made.read_text(encoding="utf-8") != text:
        TREE.mkdir(parents=True, exist_ok=True)
        made.write_text(text, encoding="utf-8")
        made.chmod(0o755)
    return made


def play_hostile(library: Path, compiler: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """hostile_runs.py with that library; Python itself is not clang's, so that the sanitizers' own has to be there
    before it, and what Python never gives back is not counted."""
    runtime = run("clang", "-print-file-name=libclang_rt.asan-x86_64.so").stdout.strip()
    return run(
        sys.executable,
        PLAYER,
        *arguments,
        PVID_NATIVE_LIBRARY=str(library),
        CC=str(compiler),
        PYTHONPATH=os.pathsep.join(filter(None, (str(ROOT / "tests"), os.environ.get("PYTHONPATH")))),
        LD_PRELOAD=runtime,
        ASAN_OPTIONS=f"detect_leaks=0:{NO_SYMBOLIZER}",
    )


@pytest.mark.night
def test_hostile_runs_of_the_library_are_clean(library: Path, compiler: Path) -> None:
    done = play_hostile(library, compiler)
    assert done.returncode == 0, done.stderr[-5000:]
    assert int(done.stdout.split()[0]) > 230_000


@pytest.mark.night
def test_write_behind_an_array_is_found(library: Path, compiler: Path) -> None:
    done = play_hostile(library, compiler, "--planted")
    assert done.returncode != 0
    assert "heap-buffer-overflow" in done.stderr and library.name in done.stderr


# ---- the program behind the serial link ----


def play_over_a_bad_line(form: str, core: str, native: Native) -> Verdict:
    """A standard run over a line that spoils one byte in 5000."""
    random = np.random.default_rng(3)
    opened = open_target(HOST_TARGET, standard_rig(form, core), lambda port: Faulty(port, 1e-4, random))
    return judge(play_standard(opened, form, core, patience_s=120.0), expected(form, core))


def start_by(monkeypatch: pytest.MonkeyPatch, script: Path, prefix: str) -> None:
    """What is started in the image's place: a script that starts the image with `prefix` before it."""

    def build(*arguments: object) -> Path:
        image = stream_image.build_image(*arguments)  # type: ignore[arg-type]
        script.write_text(f"#!/bin/sh\nexec {prefix} '{image}'\n", encoding="utf-8")
        script.chmod(0o755)
        return script

    monkeypatch.setattr(target, "build_image", build)


@pytest.mark.parametrize(
    ("form", "core"), [KINDS[0], *(pytest.param(*one, marks=pytest.mark.night) for one in KINDS[1:])]
)
def test_the_stream_program_reads_nothing_that_was_not_written(
    form: str, core: str, native: Native, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "valgrind.log"
    start_by(monkeypatch, tmp_path / "start", f"valgrind --track-origins=yes --log-file='{log}'")
    verdict = play_over_a_bad_line(form, core, native)
    said = log.read_text(encoding="utf-8")
    assert "Memcheck" in said
    # nothing after the five lines it introduces itself with
    assert not [line for line in said.splitlines()[5:] if line.split("==")[-1].strip()], said
    assert verdict.equal, verdict.text


@pytest.mark.parametrize(("form", "core"), [("weak", "f32"), pytest.param("strong", "q31", marks=pytest.mark.night)])
def test_the_stream_program_is_clean_under_the_sanitizers(
    form: str, core: str, native: Native, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiler = tmp_path / "bin" / "gcc"
    compiler.parent.mkdir()
    compiler.write_text(f'#!/bin/sh\nexec clang {SANITIZERS} -g -O0 "$@" -O0\n', encoding="utf-8")
    compiler.chmod(0o755)
    monkeypatch.setenv("PATH", f"{compiler.parent}:{os.environ['PATH']}")
    monkeypatch.setattr(stream_image, "BUILD", tmp_path / "targets")
    log = tmp_path / "sanitizers.log"
    start_by(monkeypatch, tmp_path / "start", f"env ASAN_OPTIONS='log_path={log}:{NO_SYMBOLIZER}'")
    verdict = play_over_a_bad_line(form, core, native)
    assert "".join(one.read_text(encoding="utf-8") for one in tmp_path.glob("sanitizers.log*")) == ""
    assert verdict.equal, verdict.text
