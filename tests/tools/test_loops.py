"""tools/loops.py sees what it is there for: loops that do not end, or not by what stands in them, and recursion."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ROOT

# Each loop says in its line what the tool has to say of it.
PLANTED = """
#include <stddef.h>
#include <stdint.h>

typedef struct planted {
    size_t n;
    uint32_t wide;
    float (*own)(const struct planted *self, float x);
    void (*other)(void);
} planted;

float planted_loops(planted *self, const uint8_t text[], volatile uint32_t *flag, float x[]);
float planted_even(const planted *self, float x);
float planted_odd(const planted *self, float x);
float planted_own(const planted *self, float x);
uint32_t planted_ours(uint32_t n);
void planted_start(planted *self);

float planted_loops(planted *self, const uint8_t text[], volatile uint32_t *flag, float x[])
{
    size_t i;
    for (i = 0; i < self->n; i++) { /* ends */
        x[i] += 1.0f;
    }
    for (size_t j = 8; j > 0u; j--) { /* ends */
        for (size_t k = 0; k < j; k += 2u) { /* ends: j is not the largest number */
            x[k] += x[j];
        }
    }
    for (size_t j = 0; j <= self->n; j++) { /* open: n may be the largest number */
        x[j] += 1.0f;
    }
    for (size_t j = 0; j < self->n; j += 0u) { /* open: no step */
        x[0] += 1.0f;
    }
    for (size_t j = 0; j < self->n; j++) { /* open: the counter is set back */
        j = (x[j] > 1.0f) ? 0u : j;
    }
    while (*flag == 0u) { /* open: somebody else's */
    }
    while (text[i] != 0u) { /* open: where is it? */
        i++;
    }
    while (x[0] > 1.0f) { /* open: by value */
        x[0] *= 0.5f;
    }
    do { /* open: x may be no number at all */
        x[1] -= 1.0f;
    } while (x[1] != 0.0f);
    for (uint16_t j = 0; j < self->wide; j++) { /* open: a narrow counter */
        x[j] += 1.0f;
    }
    for (;;) { /* open: on purpose */
        if (x[2] > 0.0f) {
            break;
        }
    }
    return x[0];
}

uint32_t planted_ours(uint32_t n)
{
    return (n == 0u) ? 0u : planted_ours(n - 1u);
}

float planted_even(const planted *self, float x)
{
    return (x < 1.0f) ? x : planted_odd(self, x - 1.0f);
}

float planted_odd(const planted *self, float x)
{
    return planted_even(self, x - 1.0f);
}

/* By a pointer: which function it is is nobody's to say. */
float planted_own(const planted *self, float x)
{
    return self->own(self, x);
}

/* No function of that shape has its address taken. */
void planted_start(planted *self)
{
    self->own = planted_own;
    self->other();
}
"""


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """What the tool reads, to be spoiled."""
    for name in ("tools/loops.py", "tools/kept.py", "tools/units.py", "tests/loops.toml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    shutil.copytree(ROOT / "firmware", tmp_path / "firmware")
    shutil.copytree(ROOT / "tests" / "analysis", tmp_path / "tests" / "analysis")
    return tmp_path


def run(copy: Path, *files: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(copy / "tools" / "loops.py"), *files]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_planted_loops_and_recursion_are_found(copy: Path) -> None:
    name = "firmware/src/weak/planted.c"
    (copy / name).write_text(PLANTED, encoding="utf-8")
    done = run(copy, name)
    assert done.returncode == 1, done.stderr
    lines = PLANTED.splitlines()
    wanted = {number for number, line in enumerate(lines, 1) if "/* open" in line}
    assert {int(number) for number in re.findall(rf"^{name}:(\d+): ", done.stdout, re.MULTILINE)} == wanted
    assert len(wanted) == 9
    recursive = set(re.findall(r"^(\w+) calls itself, perhaps by way of others \(host\)$", done.stdout, re.MULTILINE))
    assert recursive == {"planted_ours", "planted_even", "planted_odd", "planted_own"}


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("firmware/src/persist/crc32.c", "i < n; i++", "i < n;"),
        ("firmware/src/persist/fnv_q31.c", "i < information->n_sums; i++", "i < information->n_sums; i += 0u"),
        ("firmware/src/weak/weak_front_q31.c", "left > 0u; left--", "left > 0u; left -= 0u"),
        ("firmware/ports/freestanding/square_root.c", "shift++", ""),
    ],
)
def test_a_loop_of_ours_that_does_not_count_is_found(copy: Path, file: str, old: str, new: str) -> None:
    path = copy / file
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    path.write_text(text.replace(old, new), encoding="utf-8")
    done = run(copy, file)
    assert done.returncode == 1, done.stderr
    assert f"{file}:{text[: text.index(old)].count(chr(10)) + 1}: " in done.stdout
    assert "is not shown to end" in done.stdout


def test_reasons_do_not_outlive_their_loops(copy: Path) -> None:
    """A reason covers the loop whose line it quotes, and no other of the same file."""
    file = "firmware/ports/uart/uart_cmsdk.c"
    path = copy / file
    text = path.read_text(encoding="utf-8")
    assert run(copy, file).returncode == 0
    path.write_text(text.replace("while ((STATE & STATE_TX_FULL) != 0u)", "while (DATA != 0u)"), encoding="utf-8")
    done = run(copy, file)
    assert done.returncode == 1
    assert "while (DATA != 0u) {\n    is not shown to end" in done.stdout


def test_loops_that_the_compiler_takes_to_end_are_refused(copy: Path) -> None:
    tool = copy / "tools" / "loops.py"
    tool.write_text(tool.read_text(encoding="utf-8").replace(" -fno-finite-loops", " -ffinite-loops"), encoding="utf-8")
    done = run(copy, "firmware/src/persist/crc32.c")
    assert done.returncode != 0
    assert "crc32.c (host): loops are taken to end" in done.stderr
