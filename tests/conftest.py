"""What several tests share: the builds of the core, made once a session."""

import gc
import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import settings
from processes import children_of
from spread import run

from bench.kinds import KINDS
from pvid.base.freed_memory import keep_freed
from pvid.core.native import Native
from pvid.models.mechanisms import names

ROOT = Path(__file__).resolve().parents[1]

# The examples of a test are the same in every run, and may take their time: a failure is one of the code, on any
# machine. (One of 280 ms on a busy machine was beyond Hypothesis's deadline of 200 ms.)
settings.register_profile("seeded", derandomize=True, deadline=None)
settings.load_profile("seeded")

# Files that `./tools/test quick` leaves out: images, emulators, builds, tools, many identifications. tools/test gives
# each of its workers a file at a time, these first and in this order: the longest before the others, so that they
# end together.
SLOW = """
    cli/cli cli/identify_in_c cli/identify_run oracle/missing identification/refined_search
    log/log show/page twin/weak_q31 identification/work board/memory identification/mechanism_advice
    codegen/strong_model cli/design_cost paper/paper cli/run_input bench/refine_mechanisms show/answer_figure
    show/report board/stream cli/mutants cli/look deploy/commission identification/refined_answer
    identification/refined_kinds oracle/samples
    board/ports board/profile core/standard_errors identification/refined_kernel base/subprocesses
    identification/additions deploy/deploy twin/weak_f32 codegen/build log/liar cli/demo_run identification/judge
    tools/pages core/trust_q31 cli/api identification/scale_errors board/targets identification/own_mechanisms
    identification/refined twin/second_stage show/view board/refined_board tools/wheel
    board/strong_image codegen/robot_core board/robot_board cli/several board/mechanism_board board/field
    core/read_while_stepping cli/foreign_files
    identification/several_recordings fleet/batch board/refined_stream codegen/generated_q31 bench/mechanisms
    cli/readme log/verify log/witness oracle/weak_in_c board/weak_boards core/weak_rows_q31 core/arithmetic_options
    codegen/weak_c core/recorded_hashes oracle/feedback codegen/generated_f32 oracle/weak_identify
    core/sizes_agree twin/state tools/notebooks oracle/corners model/elimination
    core/kinds_q31 tools/core_rooms oracle/weak_choice tools/consumer codegen/strong_model_q31 link/link
    twin/runs_begin oracle/scale identification/refined_length core/refinement codegen/refine
    core/dropped_calls sim/rigs core/bad_config bench/longevity core/model_library core/equation_error tools/docs
    identification/wild_samples board/port cli/output tools/proofs log/untrusted
    show/pictures tools/loops oracle/strong_described tools/analysis codegen/random
    board/block bench/hard log/export log/text_table core/dead_zone tools/mutate bench/model_boards
    deploy/deploy_avr identification/skew cli/result deploy/examples log/former_logs
    design/differentiation identification/following codegen/fitted_sizes identification/gallery
    sim/pendulum oracle/weak_segments base/packages core/snapshot_weak oracle/failures rig/former_files oracle/zero
    identification/weak_files_q31 model/mecanum core/weak_snapshot_q31 core/strong_errors
""".split()
# Of tests of every mechanism in bench.kinds those of these four: relaxations, an integral, an algebraic output; corners
# and dry friction; an input that is a derivative; a hidden coordinate of order two. The others are tests of the night.
BY_DAY = ("battery_2rc", "dc_motor", "kapitza", "two_mass_drive")
_NONE = SimpleNamespace(params={})


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--long", action="store_true", help="The long forms of the tests that have one.")
    parser.addoption("--workers", type=int, default=1, help="Processes, each of which takes a file at a time.")


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--workers") < 1:
        raise pytest.UsageError("--workers: at least 1")
    keep_freed()
    gc.set_threshold(50_000, 20, 100)  # modules and SymPy's expressions live to the end: 5 % of the time found nothing
    config.addinivalue_line("markers", "ticks(short, long): the length of a run, here and with --long")
    config.addinivalue_line("markers", "longer: has a long form without a number of ticks")
    config.addinivalue_line("markers", "long: with --long alone, in `./tools/test night`")
    config.addinivalue_line("markers", "by_day(number): its first cases; the others in `./tools/test night`")
    config.addinivalue_line("markers", "slow: left out of `./tools/test quick`")
    config.addinivalue_line(
        "markers", "night: what is handed out or measured, as its user has it; in `./tools/test night`"
    )


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> bool | None:
    workers = session.config.getoption("--workers")
    if workers == 1 or session.config.option.collectonly or session.testsfailed:
        return None
    run(session, workers)
    return True


@pytest.fixture
def ticks(request: pytest.FixtureRequest) -> int:
    """The length of a run [ticks], of the test's mark of that name."""
    mark = request.node.get_closest_marker("ticks")
    return int(mark.kwargs["long" if request.config.getoption("--long") else "short"])


def of_night(items: list[pytest.Item]) -> Iterator[pytest.Item]:
    """Of tests of the mechanisms of KINDS (a light test takes all there are) those that are not in BY_DAY; and cases
    behind the first ones of a test that is marked so."""
    swept: dict[tuple[str, str], list[tuple[str, pytest.Item]]] = {}
    for item in items:
        for argument, value in getattr(item, "callspec", _NONE).params.items():
            if isinstance(value, str):
                swept.setdefault((item.nodeid.partition("[")[0], argument), []).append((value, item))
    for cases in swept.values():
        if {*KINDS} <= {value for value, _ in cases} and not {*names()} <= {value for value, _ in cases}:
            yield from (item for value, item in cases if value in {*KINDS} - {*BY_DAY})
    seen: Counter[str] = Counter()
    for item in items:
        mark = item.get_closest_marker("by_day")
        if mark is not None:
            seen[item.nodeid.partition("[")[0]] += 1
            if seen[item.nodeid.partition("[")[0]] > mark.args[0]:
                yield item


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Puts the longest files first; within a file, and among the others, nothing moves."""
    for item in of_night(items):
        item.add_marker(pytest.mark.night)
    if not config.getoption("--long"):
        left_out = [item for item in items if item.get_closest_marker("long")]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]
    places = {name: place for place, name in enumerate(SLOW)}
    files = {item: f"{item.path.parent.name}/{item.path.stem.removeprefix('test_')}" for item in items}
    for item in items:
        if files[item] in places:
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
