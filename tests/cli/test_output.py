"""Output that is full, closed or read by nobody, and files that appear whole or not at all."""

import os
import resource
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import pytest
from pendulum_plant import simulate
from pendulum_run import write_run

from pvid.base.atomic_write import write_whole
from pvid.base.errors import PvidError
from pvid.base.figure_file import format_of
from pvid.base.replacing import replacing
from pvid.rig.mechanism_file import MechanismRig

PVID = [sys.executable, "-P", "-m", "pvid"]
READER_GONE = 141
NO_BYTECODE = "import sys; sys.dont_write_bytecode = True"


def printing(*arguments: str, to: IO[Any] | int, **options: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*PVID, *arguments], stdout=to, stderr=subprocess.PIPE, text=True, check=False, **options)


@pytest.mark.parametrize("arguments", [("--help",), ("schema",), ("tables", "--form", "fir", "--points", "21")])
def test_a_full_disk_is_one_sentence_and_exit_code_2(arguments: tuple[str, ...]) -> None:
    with open("/dev/full", "wb") as full:
        done = printing(*arguments, to=full)
    assert done.returncode == 2
    assert done.stderr == "pvid: the output cannot be written: No space left on device\n"


def test_a_closed_output_is_one_sentence_and_exit_code_2() -> None:
    command = f"{' '.join(PVID)} schema >&-"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == "pvid: the output cannot be written: standard output is closed\n"


def test_closed_pipe_ends_the_command_silently() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = printing("schema", to=writing)
    finally:
        os.close(writing)
    assert (done.returncode, done.stderr) == (READER_GONE, "")


def test_unhandled_messages_change_nothing(tmp_path: Path) -> None:
    for where in ("2>&-", "2>/dev/full"):
        command = f"{' '.join(PVID)} simulate run.csv --duration 1 {where}"
        done = subprocess.run(command, shell=True, cwd=tmp_path, check=False)
        assert done.returncode == 0


def test_a_table_that_does_not_fit_leaves_an_empty_file(tmp_path: Path) -> None:
    def bounded() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))

    # whose bytecode would be cut short, too, and break every later run
    command = [sys.executable, "-P", "-c", f"{NO_BYTECODE}; from pvid.cli.main import main; main()"]
    table = tmp_path / "table.h"
    with table.open("wb") as file:
        done = subprocess.run(
            [*command, "tables", "--form", "fir"],
            stdout=file,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            preexec_fn=bounded,
        )
    assert done.returncode == 2
    assert done.stderr == "pvid: the output cannot be written: File too large\n"
    assert table.read_bytes() == b""


# ---- files


@contextmanager
def files_up_to(size: int) -> Iterator[None]:
    """As a disk that is nearly full. Python would cut short the bytecode, too, of what is first imported meanwhile."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sys, "dont_write_bytecode", True)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    from matplotlib.figure import Figure

    from pvid.base.figure_file import save

    run = simulate(duration=1.0).run
    figure = Figure()
    figure.subplots().plot(run.t, run.phi)
    names = [tmp_path / name for name in ("rig.toml", "figure.png", "run.csv")]
    for path in names:
        path.write_text("old", encoding="utf-8")
    with files_up_to(10), replacing():
        with pytest.raises(PvidError, match="rig.toml: cannot be written: File too large"):
            MechanismRig("kapitza").write(names[0])
        with pytest.raises(PvidError, match="cannot write the figure .*File too large"):
            save(figure, names[1], dpi=50)
        with pytest.raises(PvidError, match="run.csv cannot be written: File too large"):
            write_run(names[2], run)
    assert sorted(tmp_path.iterdir()) == sorted(names)
    assert all(path.read_text(encoding="utf-8") == "old" for path in names)


def test_a_device_is_written_to_and_stays_one() -> None:
    write_whole(Path("/dev/null"), "nothing")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    with pytest.raises(OSError, match="No space left"):
        write_whole(Path("/dev/full"), "nothing")
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


def test_a_link_is_refused_and_by_force_stays_while_its_target_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    target, link = tmp_path / "there" / "rig.toml", tmp_path / "link.toml"
    target.write_text("old", encoding="utf-8")
    link.symlink_to(target)
    with pytest.raises(PvidError, match=r"link.toml is a link to .*rig.toml: name that file"):
        write_whole(link, "new")
    assert target.read_text(encoding="utf-8") == "old"
    with replacing():
        write_whole(link, "new")
    assert link.is_symlink() and target.read_text(encoding="utf-8") == "new"


def test_the_longest_name_is_written_and_a_folder_is_refused(tmp_path: Path) -> None:
    name = tmp_path / ("a" * 251 + ".csv")
    write_whole(name, "new")
    assert name.read_text(encoding="utf-8") == "new"
    with pytest.raises(IsADirectoryError):
        write_whole(tmp_path, "new")


def test_a_figure_has_a_format_that_every_machine_writes() -> None:
    assert [format_of(Path(name)) for name in ("a.PNG", "a.svg", "a.pdf", "a")] == ["png", "svg", "pdf", "png"]
    for name in ("a.pgf", "a.exe", "a.png.txt"):
        with pytest.raises(PvidError, match="must end in .png, .svg, .pdf"):
            format_of(Path(name))
