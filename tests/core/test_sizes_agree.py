"""init refuses an application whose sizes are not the library's and writes nothing: every size, C and C++."""

import re
import subprocess
from pathlib import Path

import pytest

from pvid.core.sources import INCLUDES, PUBLIC_INCLUDES, core_sources, public_headers
from pvid.settings.enums import Status

SOURCES = core_sources()

# Every size of config.h, and another value than its default that is allowed.
OTHER = {
    "PVID_MAX_WINDOW": 81,
    "PVID_MAX_THETA": 12,
    "PVID_MAX_P": 6,
    "PVID_MAX_MOMENTS": 55,
    "PVID_MAX_CONSTRAINTS": 2,
    "PVID_MAX_DRIFTS": 1,
    "PVID_MAX_DECIMATION": 64,
    "PVID_MAX_FUNCTIONS": 12,
    "PVID_MAX_ITERATIONS": 20,
    "PVID_MAX_THETA_Q31": 12,
    "PVID_MAX_MOMENTS_Q31": 78,
    "PVID_MAX_C_Q31": 24,
    "PVID_MAX_SAMPLES": 3,
    "PVID_MAX_RING": 500,
    "PVID_MAX_INPUTS": 15,
    "PVID_MAX_CHANNELS": 9,
    "PVID_MAX_INTEGRANDS": 2,
    "PVID_MAX_HARMONICS": 17,
    "PVID_MAX_KINDS": 1,
    "PVID_MAX_COLUMNS": 14,
    "PVID_MAX_POWER": 6,
    "PVID_MAX_BLOCKS": 1,
    "PVID_MAX_WINDOWS": 0,
    "PVID_FEEDBACK": 0,
}

# Of a build for one design, whose structs have no more than it needs.
EXACT = ("", *(f"_{one}" for one in "SIGNALS JETS RUNS SIGNS GAINS INTEGRANDS CHANNELS PLAIN".split()))

LANGUAGES = {"c": ("gcc", "-std=c99"), "cpp": ("g++", "-std=c++11")}

# Prints for each object the status of its init, then whether the object and the bytes behind it are as before.
USER = """#include <stdio.h>
#include <string.h>
#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"
#define ROOM 65536
#define TRY(type, init, calls) do {                                        \\
    static struct { type object; unsigned char behind[ROOM]; } memory;     \\
    static type zeros;                                                     \\
    memset(memory.behind, 0xA5, ROOM);                                     \\
    type *const self = &memory.object;                                     \\
    const int status = (int)(init);                                        \\
    calls;                                                                 \\
    int same = memcmp(self, &zeros, sizeof zeros) == 0;                    \\
    for (int i = 0; i < ROOM; i++) { same = same && memory.behind[i] == 0xA5; } \\
    printf("%s %d %d\\n", #type, status, same);                            \\
} while (0)
static pvid_weak_config_f32 weak; static pvid_estimator_config_f32 of_rows; static pvid_fir_bank_f32 bank;
static pvid_weak_config_q31 weak_q31; static pvid_estimator_config_q31 of_rows_q31;
int main(void)
{
    static float sample[64]; static int32_t reading[64]; static pvid_estimate_f32 estimate; uint32_t number;
    TRY(pvid_weak_f32, pvid_weak_init_f32(self, &weak),
        if (pvid_weak_step_f32(self, sample) != PVID_NOT_READY) return 1;
        if (pvid_weak_read_f32(self, &estimate, &number)) return 1;
        pvid_weak_gap_f32(self); pvid_weak_freeze_f32(self, true));
    TRY(pvid_weak_q31, pvid_weak_init_q31(self, &weak_q31),
        if (pvid_weak_step_q31(self, reading) != PVID_NOT_READY) return 2; pvid_weak_gap_q31(self));
    TRY(pvid_estimator_f32, pvid_estimator_init_f32(self, &of_rows),
        if (pvid_estimator_step_f32(self, sample, 1.0f) != PVID_NOT_READY) return 3);
    TRY(pvid_estimator_q31, pvid_estimator_init_q31(self, &of_rows_q31),
        if (pvid_estimator_update_q31(self) != PVID_NOT_READY) return 4);
    TRY(pvid_differentiator_f32, pvid_differentiator_init_f32(self, &bank, 1000.0f), (void)0);
    printf("%s\\n%s\\n", pvid_layout_sizes(), PVID_LAYOUT_SIZES);
    return (pvid_layout() == PVID_LAYOUT) ? 0 : 5;
}
"""
OBJECTS = [f"pvid_{one}" for one in ("weak_f32", "weak_q31", "estimator_f32", "estimator_q31", "differentiator_f32")]


def run(*command: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, cwd=cwd, check=False)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The library with the default sizes, as who copies include and src makes it."""
    folder = tmp_path_factory.mktemp("library")
    done = run("gcc", "-std=c99", "-O0", *INCLUDES, "-c", *SOURCES, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert run("ar", "rcs", folder / "libpvid.a", *sorted(folder.glob("*.o"))).returncode == 0
    return folder / "libpvid.a"


def said(folder: Path, language: str, library: Path, *sizes: str) -> tuple[int, dict[str, tuple[int, int]], list[str]]:
    """Exit code of the application compiled with those sizes; status and sameness by object; both sizes in words."""
    source = folder / f"user.{language}"
    source.write_text(USER, encoding="utf-8")
    done = run(*LANGUAGES[language], *sizes, *PUBLIC_INCLUDES, source, library, "-lm", "-o", folder / "user")
    assert done.returncode == 0, done.stderr
    done = run(folder / "user")
    *lines, of_library, own = done.stdout.splitlines()
    objects = {name: (int(status), int(same)) for name, status, same in map(str.split, lines)}
    return done.returncode, objects, [of_library, own]


def test_every_size_of_the_headers_is_tried() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in public_headers())
    assert set(re.findall(r"#ifndef (PVID_MAX_\w+|PVID_FEEDBACK)", text)) == set(OTHER)


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_same_sizes_are_accepted(language: str, library: Path, tmp_path: Path) -> None:
    """Each init refuses the empty configuration itself, and its object is all zeros again."""
    code, objects, (of_library, own) = said(tmp_path, language, library)
    assert code == 0 and of_library == own and sorted(objects) == sorted(OBJECTS)
    assert all(one not in (Status.OK, Status.BAD_LAYOUT) and same for one, same in objects.values()), objects


@pytest.mark.parametrize(("language", "name"), [*(("c", one) for one in OTHER), ("cpp", "PVID_MAX_P")])
def test_another_size_is_refused_and_nothing_is_written(
    language: str, name: str, library: Path, tmp_path: Path
) -> None:
    code, objects, (of_library, own) = said(tmp_path, language, library, f"-D{name}={OTHER[name]}")
    assert code == 5 and objects == dict.fromkeys(OBJECTS, (int(Status.BAD_LAYOUT), 1))
    told = name.removeprefix("PVID_").removeprefix("MAX_").lower()
    different = set(own.split()) - set(of_library.split())
    assert different == {f"{told}={OTHER[name]}"}


def test_a_build_for_one_design_is_refused(library: Path, tmp_path: Path) -> None:
    code, objects, (of_library, own) = said(
        tmp_path, "c", library, *(f"-DPVID_EXACT{name}={place}" for place, name in enumerate(EXACT, 1))
    )
    assert code == 5 and objects == dict.fromkeys(OBJECTS, (int(Status.BAD_LAYOUT), 1))
    assert "exact=1 exact_plain=9 exact_runs=4 exact_signs=5 exact_gains=6 exact_integrands=7" in own
