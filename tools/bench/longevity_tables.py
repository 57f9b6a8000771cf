"""Results of the longevity bench that stay, and the tables of them in host/docs/benchmarks/longevity.md."""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
import subprocess
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

from bench.longevity import (
    BACK,
    COLUMNS,
    LIBRARY,
    OURS,
    PEERS,
    Lane,
    Outcome,
    build_library,
    measure,
)
from bench.longevity_signals import BEFORE, HELD_OUT, SCENARIOS, Disturbance
from pvid.base.errors import PvidError
from pvid.board.boards import one_at_a_time
from pvid.core.native import Native
from pvid.core.sources import FOLDERS, ROOT, core_sources
from pvid.settings.enums import Reason

RESULTS = ROOT / "build" / "longevity" / "results.json"
TICKS = 10_000_000
HELD_OUT_TICKS = 1_000_000

Table = tuple[str, tuple[str, ...], list[tuple[str, ...]]]  # marker, header, rows


# ---- what stays, in RESULTS ----


@cache
def code_digest(core: str) -> str:
    """Of the C code of a core, as the compiler sees it: comments move nothing. core: f32, q31 or peers."""
    folders = [*FOLDERS, *(ROOT / "tests" / name for name in ("longevity", "cost"))]
    sources = core_sources("*_q31.c" if core == "q31" else "*_f32.c")
    if core == "peers":
        sources += sorted((ROOT / "tests" / "longevity").glob("*.c"))
    command = ["gcc", "-std=c99", "-E", "-P", *(f"-I{folder}" for folder in folders)]
    try:
        done = subprocess.run([*command, *map(str, sources)], capture_output=True, check=False)
    except OSError as error:
        raise PvidError(f"cannot run gcc: {error.strerror}") from error
    if done.returncode != 0:
        raise PvidError(f"gcc refused the core: {done.stderr.decode(errors='replace').strip()[:200]}")
    return hashlib.sha256(done.stdout).hexdigest()[:16]


def _core_of(column: str) -> str:
    return "peers" if column == "peers" else COLUMNS[column][0].core


def measured_with(core: str, *what: object) -> str:
    """What a result depends on: the core's code, and what was played."""
    return hashlib.sha256("\n".join([code_digest(core), *map(repr, what)]).encode()).hexdigest()[:16]


def load(key: str, name: str, ticks: int, made_with: str) -> dict[str, Any] | None:
    """An earlier result of at least so many ticks, None where there is none that was made with the same."""
    stored = _all().get(key, {}).get(name)
    good = stored is not None and stored["ticks"] >= ticks and stored["made_with"] == made_with
    return stored if good else None


def keep(key: str, name: str, ticks: int, made_with: str, result: dict[str, Any]) -> dict[str, Any]:
    """Adds a result, for the next call, which goes on from there; returns it as `load` does."""
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    stored = {"ticks": ticks, "made_with": made_with, **result}
    with one_at_a_time(RESULTS.parent):
        results = _all()
        results.setdefault(key, {})[name] = stored
        fresh = RESULTS.with_suffix(".new")
        fresh.write_text(json.dumps(results, indent=1), encoding="utf-8")
        os.replace(fresh, RESULTS)
    return stored


def _all() -> dict[str, dict[str, Any]]:
    return dict(json.loads(RESULTS.read_text(encoding="utf-8"))) if RESULTS.exists() else {}


# ---- the campaign ----


@dataclass(frozen=True)
class Task:
    """A disturbance and what is measured of it together."""

    disturbance: Disturbance
    column: str
    ticks: int

    @property
    def made_with(self) -> str:
        """What its result depends on."""
        return measured_with(_core_of(self.column), self.disturbance, COLUMNS[self.column])

    def stored(self) -> dict[str, Any] | None:
        """Its result, where there is one."""
        return load(self.disturbance.title, self.column, self.ticks, self.made_with)


def tasks_of(disturbances: Iterable[Disturbance], columns: Iterable[str], ticks: int) -> list[Task]:
    """One column after the other."""
    among = list(disturbances)
    return [Task(one, column, ticks) for column in columns for one in among]


def _measure_alone(library: Path, task: Task) -> dict[str, Any]:
    """In a process of its own."""
    outcomes = measure(Native(), ctypes.CDLL(str(library)), task.disturbance, COLUMNS[task.column], task.ticks)
    return {"lanes": {label: asdict(one) for label, one in outcomes.items()}}


def run_missing(tasks: Sequence[Task], folder: Path, processes: int, progress: Callable[[int], None]) -> None:
    """Measures what is not there yet, so many tasks at a time, and keeps each as soon as it is done.

    `progress` is told how many are there.
    """
    build_library(folder)
    missing = [task for task in tasks if task.stored() is None]
    there = len(tasks) - len(missing)
    progress(there)
    with ProcessPoolExecutor(processes) as pool:
        work = {pool.submit(_measure_alone, folder / LIBRARY, task): task for task in missing}
        for number, done in enumerate(as_completed(work), start=1):
            task = work[done]
            keep(task.disturbance.title, task.column, task.ticks, task.made_with, done.result())
            progress(there + number)


# ---- the tables ----


def _cell(lane: Lane, one: Outcome, ticks: int) -> str:
    if lane.kind in PEERS:
        if one.ticks < ticks:
            return f"NaN {one.ticks - int(BEFORE * ticks)} ticks on"
        return f"{abs(one.error_after):.2g} %" if abs(one.error_after) < 100 else "> 100 %"
    if one.not_finite or one.singular:
        return "NOT FINITE" if one.not_finite else "SINGULAR"
    error = f"{abs(one.error_after):.2g} %" + (f", {one.far} of {one.published} far" if one.far else "")
    if one.told == Reason.UPDATED.text:
        return error if one.errors <= BACK else f"{error}, **{one.errors:.1f} s.e.**"
    return f"{error}, {'alarm' if one.told == Reason.MISFIT.text else one.told}"


def tables(ticks: int = 0) -> Iterator[Table]:
    """The tables of SCENARIOS from results of at least so many ticks; rows that are not measured are left out."""
    for column, lanes in COLUMNS.items():
        rows = []
        for one in SCENARIOS.values():
            task = Task(one, column, ticks)
            stored = task.stored()
            if stored is None:
                continue
            done = stored["ticks"]
            cells = [_cell(lane, Outcome(**stored["lanes"][lane.label]), done) for lane in lanes]
            rows.append((one.title, f"{done:.0e}".replace("e+0", "e"), *cells))
        yield f"longevity-{column}", ("disturbance", "ticks", *(lane.label for lane in lanes)), rows


def _fate(one: Outcome) -> str:
    if one.not_finite or one.singular:
        return "broken"
    if one.silent:
        return "silent"
    return "right" if one.told == Reason.UPDATED.text else "told"


def held_out_table(ticks: int = HELD_OUT_TICKS) -> Table:
    """How many cells of each column end right, with an alarm or silently wrong, and the signals of the latter."""
    rows = []
    for column in OURS:
        fates, wrong = Counter[str](), []
        for disturbance in HELD_OUT:
            stored = Task(disturbance, column, ticks).stored()
            for one in (stored["lanes"] if stored else {}).values():
                fate = _fate(Outcome(**one))
                fates[fate] += 1
                wrong += [disturbance.title] if fate in ("silent", "broken") else []
        counts = [str(fates[fate]) for fate in ("right", "told", "silent", "broken")]
        rows.append((column.replace("-", " "), str(fates.total()), *counts, "; ".join(sorted(set(wrong)))))
    header = ("form", "cells", "right", "alarm", "silently wrong", "not finite", "wrong after")
    return "longevity-held-out", header, rows
