"""Tests in several processes, which are forks of the one that has collected them: modules are imported and tests
collected once, and each fork takes the next file when it has done one."""

import gc
import os
import warnings
from collections.abc import Iterable, Iterator
from itertools import groupby
from multiprocessing.connection import Connection, Pipe, wait
from typing import Any, NoReturn

import pytest

_NUMBER = 2  # bytes of the number of a file


class _Told:
    """What a fork tells the process that collected."""

    def __init__(self, config: pytest.Config, to: Connection) -> None:
        self.config, self.to = config, to

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self.to.send(("runs", nodeid))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        data = self.config.hook.pytest_report_to_serializable(config=self.config, report=report)
        self.to.send(("report", data))

    def pytest_warning_recorded(
        self, warning_message: warnings.WarningMessage, when: str, nodeid: str, location: Any
    ) -> None:
        one = warning_message
        text = warnings.WarningMessage(str(one.message), UserWarning, one.filename, one.lineno)
        self.to.send(("warning", {"warning_message": text, "when": when, "nodeid": nodeid, "location": location}))


def _taken(files: list[list[pytest.Item]], numbers: int) -> Iterator[pytest.Item]:
    """Tests of the files whose numbers this process reads from the pipe, which others read, too."""
    while number := os.read(numbers, _NUMBER):
        yield from files[int.from_bytes(number)]


def _fork(session: pytest.Session, items: Iterator[pytest.Item], to: Connection) -> NoReturn:
    config = session.config
    capture = config.pluginmanager.getplugin("capturemanager")
    capture.stop_global_capturing()
    capture.start_global_capturing()  # its files are not shared with other forks
    config.pluginmanager.unregister(name="terminalreporter")
    config.pluginmanager.register(_Told(config, to))
    item = next(items, None)
    while item is not None:
        following = next(items, None)
        config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        item = following
    to.send(("done", None))
    os._exit(0)


def run(session: pytest.Session, workers: int) -> None:
    """All tests that have been collected; a fork that ends before its tests is a failure."""
    config, hook = session.config, session.config.hook
    files = [[*of_file] for _, of_file in groupby(session.items, key=lambda item: item.path)]
    numbers, queue = os.pipe()
    os.write(queue, b"".join(k.to_bytes(_NUMBER) for k in range(len(files))))
    os.close(queue)
    config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]  # one folder for all
    config.pluginmanager.getplugin("terminalreporter").showfspath = False
    gc.collect()
    gc.freeze()
    forks: dict[Connection, tuple[int, str]] = {}
    for _ in range(min(workers, len(files))):
        here, there = Pipe(duplex=False)
        pid = os.fork()
        if not pid:
            try:
                _fork(session, _taken(files, numbers), there)
            finally:
                os._exit(1)
        there.close()
        forks[here] = (pid, "")
    try:
        while forks:
            _hear(forks, hook, config, wait([*forks]))
            if session.shouldfail or session.shouldstop:
                os.read(numbers, len(files) * _NUMBER)  # forks end after the file that they are at
    finally:
        os.close(numbers)
        for pid, _ in forks.values():
            os.waitpid(pid, 0)
    if session.shouldfail:
        raise session.Failed(session.shouldfail)
    if session.shouldstop:
        raise session.Interrupted(session.shouldstop)


def _hear(forks: dict[Connection, tuple[int, str]], hook: Any, config: pytest.Config, ready: Iterable[Any]) -> None:
    for one in ready:
        pid, nodeid = forks[one]
        try:
            what, data = one.recv()
        except EOFError:
            what, data = "lost", nodeid
        if what == "runs":
            forks[one] = (pid, data)
        elif what == "warning":
            hook.pytest_warning_recorded.call_historic(kwargs=data)
        elif what == "report":
            hook.pytest_runtest_logreport(report=hook.pytest_report_from_serializable(config=config, data=data))
        else:
            del forks[one]
            _, status = os.waitpid(pid, 0)
        if what == "lost":
            code = os.waitstatus_to_exitcode(status)
            why = f"its process ended with {code}; what it had not run yet of its file is lost"
            place = (nodeid.partition("::")[0], None, nodeid)
            hook.pytest_runtest_logreport(
                report=pytest.TestReport(nodeid, place, {}, "failed", longrepr=why, when="call")
            )
