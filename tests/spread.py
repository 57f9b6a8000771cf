"""Tests in several processes, which are forks of the one that has collected them: modules are imported and tests
collected once, and each fork takes the next file when it has done one."""

import gc
import os
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from multiprocessing.connection import Connection, Pipe, wait
from typing import Any, NoReturn

import pytest

_NUMBER = 2  # bytes of the number of a file


@dataclass
class _Fork:
    """A process, the test that it has begun, and the error that ended it."""

    pid: int
    at: str = ""
    error: str = ""


class _Reports:
    """What a fork sends to the process that collected."""

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
    config.pluginmanager.register(_Reports(config, to))
    item = next(items, None)
    while item is not None:
        following = next(items, None)
        config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        item = following
    to.send(("done", None))
    os._exit(0)


def run(session: pytest.Session, workers: int) -> None:
    """All tests that have been collected; a fork that ends before its tests is a failure, and each that it leaves."""
    config = session.config
    files = [[*of_file] for _, of_file in groupby(session.items, key=lambda item: item.path)]
    numbers, queue = os.pipe()
    os.write(queue, b"".join(k.to_bytes(_NUMBER) for k in range(len(files))))
    os.close(queue)
    config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]  # one folder for all
    config.pluginmanager.getplugin("terminalreporter").showfspath = False
    gc.collect()
    gc.freeze()
    forks: dict[Connection, _Fork] = {}
    left = dict.fromkeys(item.nodeid for item in session.items)
    for _ in range(min(workers, len(files))):
        here, there = Pipe(duplex=False)
        pid = os.fork()
        if not pid:
            for one in (here, *forks):
                one.close()  # or a send would wait for ever behind the end of the process that reads
            try:
                _fork(session, _taken(files, numbers), there)
            except BaseException:
                there.send(("broke", traceback.format_exc()))
            finally:
                os._exit(1)
        there.close()
        forks[here] = _Fork(pid)
    try:
        while forks:
            for ready in wait([*forks]):
                _receive(ready, forks, config, left)  # type: ignore[arg-type]
            if session.shouldfail or session.shouldstop:
                os.read(numbers, len(files) * _NUMBER)  # forks end after the file that they are at
    finally:
        os.read(numbers, len(files) * _NUMBER)
        os.close(numbers)
        for connection, fork in forks.items():
            connection.close()  # a fork that has more to send ends
            os.waitpid(fork.pid, 0)
    if session.shouldfail:
        raise session.Failed(session.shouldfail)
    if session.shouldstop:
        raise session.Interrupted(session.shouldstop)
    for nodeid in left:
        _fail(config, nodeid, "not run: its process ended before")


def _receive(ready: Connection, forks: dict[Connection, _Fork], config: pytest.Config, left: dict[str, None]) -> None:
    fork, hook = forks[ready], config.hook
    try:
        what, data = ready.recv()
    except EOFError:
        what, data = "ended", None
    if what == "runs":
        fork.at = data
    elif what == "broke":
        fork.error = data
    elif what == "warning":
        hook.pytest_warning_recorded.call_historic(kwargs=data)
    elif what == "report":
        left.pop(data["nodeid"], None)
        hook.pytest_runtest_logreport(report=hook.pytest_report_from_serializable(config=config, data=data))
    else:
        del forks[ready]
        _, status = os.waitpid(fork.pid, 0)
        if what == "ended":
            left.pop(fork.at, None)
            _fail(config, fork.at, f"{fork.error}its process ended with {os.waitstatus_to_exitcode(status)}")


def _fail(config: pytest.Config, nodeid: str, why: str) -> None:
    place = (nodeid.partition("::")[0], None, nodeid)
    report = pytest.TestReport(nodeid, place, {}, "failed", longrepr=why, when="call")
    config.hook.pytest_runtest_logreport(report=report)
