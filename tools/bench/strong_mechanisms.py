"""The strong form of every described mechanism on emulated boards: its bits, and what a tick costs."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS
from pvid.board.strong_image import play_on_board
from pvid.compare.strong import StrongComparison
from pvid.models import mechanisms
from pvid.rig.run import Recording
from pvid.sim.simulated_run import simulation_of

ON = ("mps2-an386", "microbit", "virt-rv32imac")
TICKS = 1200
HEADER = ("mechanism", "samples of a window", "state [B]", *(BOARDS[one].core for one in ON), "bits")
STEPS = len(mechanisms.names())


def comparison_of(name: str, ticks: int = TICKS) -> StrongComparison:
    """The first samples of a mechanism's shipped rig through the strong form in C on this machine and its twin."""
    simulation = simulation_of(name)
    run = simulation.run(seed=1)
    signals = {one.name: run[one.name][:ticks] for one in simulation.model.signals}
    return StrongComparison.of(simulation.model, Recording(run["t"][:ticks], signals, simulation.rig.sample_rate))


def row_of(name: str) -> tuple[str, ...]:
    """A row of the table: instructions of a tick, mean / longest, on each board; whether all bits are the twin's."""
    run = comparison_of(name)
    costs, equal, state = [], run.found.equal, "-"
    for target in ON:
        try:
            report = play_on_board(target, run)
        except PvidError:
            costs.append("does not fit")
            continue
        costs.append(f"{report.instructions_mean:.0f} / {report.instructions_longest:.0f}")
        equal = equal and report.differs_at(run.hashes) is None
        state = str(report.state_bytes) if state == "-" else state
    return name, str(run.design.config.window), state, *costs, "equal" if equal else "DIFFERENT"


def rows_of(progress: Callable[[int], None] = lambda _: None) -> Iterator[tuple[str, ...]]:
    """All rows."""
    for done, name in enumerate(mechanisms.names()):
        progress(done)
        yield row_of(name)
