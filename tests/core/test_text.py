"""Texts of reasons and statuses in C: those of the host; left out by a macro."""

import subprocess
from pathlib import Path

from pvid.core.sources import PUBLIC_INCLUDES, source
from pvid.settings.enums import Reason, Status

PROGRAM = """
#include <stdio.h>
#include "pvid/text.h"
int main(void)
{
    for (int k = 0; k < 100; k++) {
        printf("%s\\n%s\\n", pvid_reason_text((pvid_reason)k), pvid_status_text((pvid_status)k));
    }
    return 0;
}
"""


def printed(folder: Path, *options: str) -> list[str]:
    (folder / "main.c").write_text(PROGRAM, encoding="utf-8")
    command = ["gcc", "-std=c99", "-Wall", "-Werror", *options, *PUBLIC_INCLUDES, "main.c", str(source("text.c"))]
    subprocess.run([*command, "-o", "main"], cwd=folder, check=True)
    return subprocess.run([folder / "main"], capture_output=True, text=True, check=True).stdout.splitlines()


def test_texts_are_those_of_the_host(tmp_path: Path) -> None:
    lines = printed(tmp_path)
    assert lines[: 2 * len(Reason) : 2] == [one.text for one in Reason]
    assert [one.partition(":")[0] for one in lines[1 : 2 * len(Status) : 2]] == [one.text for one in Status]
    assert set(lines[2 * len(Status) :]) == {"unknown reason", "unknown status"}
    assert len(lines) == 200


def test_a_macro_leaves_them_out(tmp_path: Path) -> None:
    assert set(printed(tmp_path, "-DPVID_TEXTS=0")) == {""}
    assert b"not finite" not in (tmp_path / "main").read_bytes()
