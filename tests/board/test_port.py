"""Ports as a user names them: a device, a socket; and what is said where one does not open."""

import errno
import os
import re
import select
import socket
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from processes import PATIENCE_S, until
from test_stream import TICKS, expected, play_standard, standard_rig

from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS
from pvid.board.stream_image import build_image
from pvid.board.target import judge, open_target
from pvid.core.native import Native
from pvid.link.port import open_port, opening_failure

BOARD = BOARDS["mps2-an386"]
Start = Callable[[str], "subprocess.Popen[bytes]"]


@pytest.fixture
def start() -> Iterator[Start]:
    """Starts the board with its UART where QEMU is told to have it, as a program that pvid knows nothing of."""
    running = []

    def begin(where: str) -> subprocess.Popen[bytes]:
        command = [BOARD.emulator, "-machine", BOARD.machine, "-display", "none", "-monitor", "none", "-nodefaults"]
        command += ["-nic", "none", "-kernel", str(build_image(standard_rig("weak"), BOARD)), "-serial", where]
        running.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, bufsize=0))
        return running[-1]

    yield begin
    for process in running:
        process.kill()
        process.communicate()


def assert_equal_through(name: str, native: Native) -> None:
    playback = play_standard(open_target(name, standard_rig("weak")), "weak")
    assert judge(playback, expected("weak")).equal, playback.account
    assert playback.done == TICKS


def test_a_run_goes_through_a_device_by_its_name(start: Start, tmp_path: Path, native: Native) -> None:
    process = start("pty")
    assert process.stdout is not None
    output = b""
    while (found := re.search(rb"(/dev/\S+)\s", output)) is None:
        assert select.select([process.stdout], [], [], PATIENCE_S)[0]
        output += process.stdout.read(200)
    name = tmp_path / "ttyACM0"  # as udev names a board
    name.symlink_to(found.group(1).decode())
    assert_equal_through(str(name), native)


def test_a_run_goes_through_a_socket(start: Start, native: Native) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        number = free.getsockname()[1]
    start(f"tcp:127.0.0.1:{number},server=on,wait=off")
    url = f"socket://127.0.0.1:{number}"

    def opens() -> bool:
        try:
            open_port(url).close()
        except PvidError:
            return False
        return True

    until(opens)
    assert_equal_through(url, native)


@pytest.mark.parametrize(
    "name", [pytest.param("microbit", marks=pytest.mark.night), pytest.param("virt-rv32imac", marks=pytest.mark.night)]
)
def test_bytes_during_startup_do_not_block_the_receiver(name: str, native: Native) -> None:
    """A byte in the UART before its interrupt was on: some UARTs then never call again."""
    for _ in range(3):
        target = open_target(name, standard_rig("strong"))
        assert play_standard(replace(target, coming_up_s=0.0), "strong", patience_s=60).complete


def test_a_port_in_use_is_named() -> None:
    ours, theirs = os.openpty()
    name = os.ttyname(theirs)
    port = open_port(name)
    with pytest.raises(PvidError, match=f"^the port {name} is in use by another program$"):
        open_port(name)
    port.close()
    open_port(name).close()
    os.close(ours)
    os.close(theirs)


def test_non_port_is_refused_by_name(tmp_path: Path) -> None:
    nowhere = tmp_path / "ttyUSB0"
    with pytest.raises(PvidError, match=f"^there is no port {nowhere}: is the board plugged in"):
        open_port(str(nowhere))
    nowhere.write_text("a file")
    with pytest.raises(PvidError, match=f"^{nowhere} is no serial port$"):
        open_port(str(nowhere))
    with pytest.raises(PvidError, match="^no connection to socket://127.0.0.1:1: nothing listens there$"):
        open_port("socket://127.0.0.1:1")
    with pytest.raises(PvidError, match="^cannot open the port nothing://x: invalid URL"):
        open_port("nothing://x")


def test_missing_permission_names_the_group() -> None:
    """Root, as whom the tests may run, lacks none."""
    error = OSError(errno.EACCES, "Permission denied")
    assert opening_failure("/dev/ttyACM0", error) == (
        "no permission to open the port /dev/ttyACM0: its group (dialout) has it"
    )
