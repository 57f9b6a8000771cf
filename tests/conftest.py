"""What several tests share: the builds of the core and the standard rig, made once a session."""

from __future__ import annotations

import gc
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from processes import children_of

from pvid.core.native import Native
from pvid.sim.pendulum import Simulation, simulate, standard_sensors

ROOT = Path(__file__).resolve().parents[1]

# Files that `./tools/test quick` leaves out: images, emulators, builds, tools, many identifications. tools/test gives
# each of its workers a file at a time, these first and in this order: the longest before the others, so that they
# end together.
SLOW = (
    *("board/targets", "tools/pages", "cli/design_cost", "tools/wheel", "run/advice", "twin/strong_bits_q31"),
    *("deploy/deploy", "bench/campaign_run", "show/report", "board/memory", "cli/mechanism_core", "cli/run_input"),
    *("bench/refine_mechanisms", "cli/cli", "log/log", "board/ports", "bench/longevity", "board/stream"),
    *("tools/notebooks", "log/verify", "codegen/build", "run/refined", "bench/refine_bench", "bench/attack"),
    *("twin/weak_f32", "tools/consumer", "core/core_q31", "fleet/batch", "bench/liar", "core/strong_q31"),
    *("models/scale_errors", "core/sizes_agree", "show/page", "bench/strong_bytes", "board/refined_stream"),
    *("twin/misfit", "bench/campaign_refined", "bench/strong_mechanisms", "board/mechanism_board", "twin/gate"),
    *("cli/mechanism", "core/read_while_stepping", "board/strong_image", "twin/refinement", "core/freeze"),
    *("twin/weak_bits_q31", "bench/hard", "core/dead_zone", "bench/cost", "twin/kinds_q31", "twin/bits"),
    *("oracle/sensor_errors", "show/view", "board/engine_boards", "cli/mechanism_demo", "bench/campaign_judge"),
    *("board/generated", "codegen/generated_q31", "twin/trust_q31", "codegen/generated_f32", "bench/side_by_side"),
    *("twin/compare", "log/export", "cli/readme", "sim/pendulum", "oracle/weak_identify", "tools/core_rooms"),
    *("cli/output", "bench/build_choices", "board/field", "sim/rigs", "oracle/weak_choice", "tools/mutate"),
    *("oracle/oracle", "core/dropped_calls", "bench/random_models", "log/untrusted", "codegen/strong_model"),
    *("core/arithmetic_options", "oracle/strong_described", "oracle/weak_engine", "core/bad_config", "tools/docs"),
    *("cli/api", "codegen/weak_c", "link/link", "tools/proofs", "tools/loops", "codegen/random", "tools/analysis"),
    *("show/pictures", "bench/year", "board/port", "run/engine_identify", "codegen/refine", "bench/mechanisms"),
    *("twin/estimator_q31", "codegen/model_q31", "run/skew", "bench/campaign_population", "twin/weak_rows_q31"),
    *("core/snapshot",),
)
# Of these, the tests that belong to the inner loop all the same.
QUICK = ("test_the_host_computes_the_bits_of_the_twin", "test_one_board_of_each_core_computes_the_bits_of_the_host")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--long", action="store_true", help="The long forms of the tests that have one (pvid bench long).")


def pytest_configure(config: pytest.Config) -> None:
    gc.set_threshold(50_000, 20, 100)  # modules and SymPy's expressions live to the end: 5 % of the time found nothing
    config.addinivalue_line("markers", "ticks(short, long): the length of a run, here and in `pvid bench long`")
    config.addinivalue_line("markers", "long: in `pvid bench long` alone")
    config.addinivalue_line("markers", "slow: left out of `./tools/test quick`")


@pytest.fixture
def ticks(request: pytest.FixtureRequest) -> int:
    """The length of a run [ticks], of the test's mark of that name."""
    mark = request.node.get_closest_marker("ticks")
    length = int(mark.kwargs["long" if request.config.getoption("--long") else "short"])
    request.node.user_properties.append(("ticks", length))
    return length


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Puts the longest files first; within a file, and among the others, nothing moves."""
    if not config.getoption("--long"):
        left_out = [item for item in items if item.get_closest_marker("long")]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]
    places = {name: place for place, name in enumerate(SLOW)}
    files = {item: f"{item.path.parent.name}/{item.path.stem.removeprefix('test_')}" for item in items}
    for item in items:
        if files[item] in places and item.name.partition("[")[0] not in QUICK:
            item.add_marker(pytest.mark.slow)
    items.sort(key=lambda item: places.get(files[item], len(places)))


def boards_running() -> dict[int, str]:
    """Emulators and stream programs that this process started and that still run: number and program."""
    found = {}
    for number in children_of(os.getpid()):
        try:
            program = os.readlink(f"/proc/{number}/exe")
        except OSError:
            continue
        if "qemu-system" in program or "apps/stream" in program:
            found[number] = program
    return found


@pytest.fixture(scope="module", autouse=True)
def _no_board_is_left_running() -> Iterator[None]:
    """A board in field mode computes until it is ended, and would slow every test after it."""
    yield
    assert boards_running() == {}


@pytest.fixture(scope="session")
def native() -> Native:
    """The build that tools/pvid uses."""
    return Native()


@pytest.fixture(scope="session")
def matrix(request: pytest.FixtureRequest, native: Native) -> dict[str, Native]:
    """The core by compiler and level (gcc-O2 ...): as it is shipped, and at -O3; in the long form at all levels."""
    others = ["gcc-O0", "clang-O0", "clang-O2"] if request.config.getoption("--long") else []
    names = ["gcc-O3", "clang-O3", *others]
    command = [str(ROOT / "tools" / "build-matrix"), *names]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    built = {Path(line).parent.name: Native(Path(line)) for line in done.stdout.splitlines()}
    assert list(built) == names
    return {"gcc-O2": native, **built}


@pytest.fixture(scope="session")
def standard_20_bits() -> Simulation:
    """The standard rig, linear truth, 20-bit encoder, 40.5 s at 1 kHz."""
    return simulate(sensors=standard_sensors(20), truth="linear", duration=40.5, seed=1)
