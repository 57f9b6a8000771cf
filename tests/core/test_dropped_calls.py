"""gcc 12 takes an array at a bare offset for a null pointer; it may then remove a call of the function that uses it."""

import re
import shlex
import subprocess
from pathlib import Path

import pytest

from pvid.board.boards import BOARDS
from pvid.board.mechanism_image_q31 import build_fixed_image, fixed_run

AGAINST_IT = "-fno-delete-null-pointer-checks"
COMMAND = re.compile(r"^(?:\S*ccache )?(?P<compile>.*) -MD .* -c (?P<source>\S+)$", re.MULTILINE)
MISTAKEN = re.compile(r"^;; Function (?P<function>\w+)|NULL memory access", re.MULTILINE)


def mistaken(options: list[str], source: str, folder: Path) -> set[str]:
    """Functions in which gcc sees a null pointer, but those that other files call: of them no call goes."""
    dumps = ("-fdump-tree-local-pure-const2", "-fdump-tree-modref2", "-dumpdir", f"{folder}/")
    subprocess.run([*options, *dumps, "-S", "-o", str(folder / "out.s"), source], check=True, capture_output=True)
    found: set[str] = set()
    for dump in (*folder.glob("*pure-const2"), *folder.glob("*modref2")):
        within = ""
        for match in MISTAKEN.finditer(dump.read_text(encoding="utf-8")):
            within = match["function"] or within
            if match["function"] is None:
                found.add(within)
        dump.unlink()
    assembly = (folder / "out.s").read_text(encoding="utf-8")
    return {name for name in found if not re.search(rf"\.(?:global|globl)\s+{name}\b", assembly)}


@pytest.mark.slow
def test_no_function_is_taken_for_one_without_effect(tmp_path: Path) -> None:
    _, tree = build_fixed_image(BOARDS["microbit"], fixed_run("kapitza"))
    said = subprocess.run(["ninja", "-C", str(tree), "-t", "commands"], capture_output=True, text=True, check=True)
    commands = list(COMMAND.finditer(said.stdout))
    assert any(match["source"].endswith("weak_finish_q31.c") for match in commands)
    for match in (one for one in commands if "/firmware/src/" in one["source"] or "/models/" in one["source"]):
        options = shlex.split(match["compile"])
        assert AGAINST_IT in options
        bare = [option for option in options if option != AGAINST_IT]
        assert mistaken(bare, match["source"], tmp_path) == set(), match["source"]


# The smallest form of what happened: the call below `begins` was removed, and the products of the fixed-point weak form
# had theta = 0.
MINIMAL = """
#include <stddef.h>
#include <stdint.h>
typedef struct { int32_t m, e; } scaled;
scaled of(int64_t x, int32_t e);
void use(scaled *x);
typedef struct { uint8_t first, n; int64_t theta[8]; int16_t bits[8]; scaled made[8]; } state;
static __attribute__((noinline)) void take(state *self)
{
    const size_t first = self->first;
    for (size_t j = 0; j < self->n; j++) {
        self->made[j] = of(self->theta[first + j], -self->bits[first + j]);
    }
}
void begins(state *self)
{
    take(self);
    use(self->made);
}
"""


def test_the_mistake_would_be_found(tmp_path: Path) -> None:
    source = tmp_path / "one.c"
    source.write_text(MINIMAL, encoding="utf-8")
    options = ["arm-none-eabi-gcc", "-mcpu=cortex-m0", "-std=c99", "-O2"]
    assert mistaken(options, str(source), tmp_path) == {"take"}
    assert mistaken([*options, AGAINST_IT], str(source), tmp_path) == set()
