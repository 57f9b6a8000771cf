"""The generated C of the weak form: its gains are the oracle's, and it compiles without a warning."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from generated import WARNINGS
from weak_forms import NAMES, native, sizes_of_all, weak_form

from pvid.core.sizes import raised
from pvid.core.sources import PUBLIC_INCLUDES

USE = """
#include "{name}_design_f32.h"
const pvid_weak_config_f32 *use(void);
const pvid_weak_config_f32 *use(void)
{{
    return &{name}_config_f32;
}}
"""


@pytest.mark.parametrize("name", NAMES)
def test_values_are_the_gains_of_the_oracle(name: str) -> None:
    """On the jets of a run: of each channel without an integral, to float32."""
    form = weak_form(name)
    record = form.rows.record
    arguments = dict(zip(map(str, record.channels.plain), record.arguments, strict=True))
    opaque = [jet for jet, value in record.channels.opaque.items() if form.model.runs and value.atoms()]
    runs = [arguments[str(jet)] for jet in opaque[: form.model.runs]]
    signs = [arguments[str(mark)] for mark in record.channels.sign_marks.values()]
    given = np.stack([*(arguments[one] for one in form.model.jet_names), *runs, *signs], axis=1)
    out = native(name).values(given.astype(np.float32))
    # The identifier has the constant behind all others, and behind the oracle's what shifts integrals.
    oracle = [(one, gains) for one, gains in zip(record.channels.channels, record.gains, strict=True) if one.gain != 1]
    for own, (channel, gains) in zip(form.model.channel, oracle, strict=False):
        assert own.fold == channel.fold
        assert np.max(np.abs(out[:, own.gain] - gains)) <= 3e-6 * np.max(np.abs(gains))


@pytest.mark.parametrize("name", NAMES)
def test_generated_files_compile_without_a_warning(name: str, tmp_path: Path) -> None:
    files = {**weak_form(name).files, "use.c": USE.format(name=name)}
    for file, text in files.items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    sizes = [f"-D{macro}={size}" for macro, size in raised(sizes_of_all()).items()]
    options = ["-std=c99", "-O1", *WARNINGS, *PUBLIC_INCLUDES, f"-I{tmp_path}", *sizes]
    for file in (f"{name}_weak_f32.c", "use.c"):
        subprocess.run(["gcc", *options, "-c", str(tmp_path / file), "-o", str(tmp_path / "x.o")], check=True)


def test_a_library_of_smaller_arrays_is_refused_by_the_compiler(tmp_path: Path) -> None:
    for file, text in weak_form("two_link_arm").files.items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    command = ["gcc", "-std=c99", *PUBLIC_INCLUDES, f"-I{tmp_path}", "-c", str(tmp_path / "two_link_arm_weak_f32.c")]
    done = subprocess.run([*command, "-o", str(tmp_path / "x.o")], capture_output=True, text=True, check=False)
    assert done.returncode != 0 and "compile pvid and this file with -DPVID_MAX_P=8" in done.stderr
