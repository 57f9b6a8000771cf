"""What a person sees of a recording fits the screen: an 80 x 24 terminal, a window of 1280 x 800, a page of paper.

PVID_PICTURES=folder ./tools/test --long tests/show/test_pictures.py      leaves the pictures there, to be looked at
"""

import os
import time
from dataclasses import replace
from pathlib import Path

import field_board
import pytest
from browser import chromium
from logs import log_of
from rich.console import Console
from selenium import webdriver

from pvid.link import frames as link
from pvid.log.file import LogWriter
from pvid.log.reader import LogStream
from pvid.settings.enums import Reason
from pvid.show.log_figure import write_log_figure
from pvid.show.page import page
from pvid.show.view import LiveView

TICKS = 20_000


@pytest.fixture(scope="module")
def sent() -> list[tuple[int, link.Message]]:
    """(tick, message) of a run of TICKS with ten estimates a second."""
    return list(field_board.messages(field_board.Field(TICKS, estimate_every=100)))


@pytest.fixture(scope="module")
def log(sent: list[tuple[int, link.Message]], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of that run, its rig file in it."""
    path = tmp_path_factory.mktemp("pictures") / "run.pvlog"
    return log_of(
        path, b"".join(field_board.frames(sent)), rig=field_board.text(), port="/dev/ttyACM0", why="ended by SIGINT"
    )


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    """Where they go."""
    folder = Path(os.environ.get("PVID_PICTURES", tmp_path)).resolve()
    folder.mkdir(exist_ok=True)
    return folder


def photograph(browser: webdriver.Chrome, path: Path) -> None:
    """What the window shows; small enough to be sent by mail."""
    assert browser.save_screenshot(str(path))
    assert 5_000 < path.stat().st_size < 200_000


def test_terminal_view_always_fits_80_by_24(
    sent: list[tuple[int, link.Message]], pictures: Path, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    def told(message: link.Message) -> link.Message:
        if isinstance(message, link.Estimate) and worst:
            return replace(message, reason=int(Reason.MISFIT), kappa=1.2e-4)
        return message

    for worst in (False, True):
        frames = [link.encode(told(message), i & 0xFFFF, tick) for i, (tick, message) in enumerate(sent)]
        console = Console(width=80, height=24, force_terminal=True, record=True, file=open(os.devnull, "w"))  # noqa: SIM115
        mechanism, stream = field_board.mechanism(), LogStream()
        view = LiveView(console, "/dev/ttyACM0 -> run.pvlog", mechanism, "http://127.0.0.1:8765/")
        writer = LogWriter(tmp_path / f"{worst}.pvlog")
        writer.begin("/dev/ttyACM0", None)
        writer.take(b"".join(frames[:300] + frames[305 if worst else 300 :]))
        if worst:
            writer.end("the port is gone: its other end was closed")
        writer.close()
        for record in stream.feed((tmp_path / f"{worst}.pvlog").read_bytes()):
            view.take(record, stream.account)
        console.print(view.panel(stream.account, time.monotonic() + 20))
        lines = console.export_text(clear=False).splitlines()
        assert len(lines) <= 24 and max(map(len, lines)) <= 80
        assert not worst or "friction, large angles" in " ".join(lines)
        assert "parameters identifiable" in "".join(lines) or worst
        if not request.config.getoption("--long"):
            continue
        (tmp_path / "terminal.svg").write_text(console.export_svg(title="pvid log"))
        with chromium(tmp_path / f"chromium{worst}", 1000, 620) as browser:
            browser.get((tmp_path / "terminal.svg").as_uri())
            photograph(browser, pictures / ("terminal-worst.png" if worst else "terminal.png"))


_TEXTS = """
    const box = (one) => { const b = one.getBoundingClientRect(); return [b.left, b.top, b.right, b.bottom]; };
    return [...document.querySelectorAll(".plots > div")].map((div) => ({
        div: box(div), title: box(div.querySelector(".gtitle")),
        legend: [...div.querySelectorAll(".legend")].map(box), below: box(div.querySelector(".xtitle"))}));
"""


@pytest.mark.long
def test_the_page_fits_1280_by_800_and_no_words_overlap(log: Path, pictures: Path, tmp_path: Path) -> None:
    with (
        page("127.0.0.1:0", log, "/dev/ttyACM0 -> run.pvlog") as address,
        chromium(tmp_path / "chromium", 1280, 800) as browser,
    ):
        limit = time.monotonic() + 60
        while not browser.title.startswith("pvid log /dev") and time.monotonic() < limit:
            browser.get(address)
            time.sleep(1)
        while not browser.execute_script("return !!document.querySelector('#signal1 .scatterlayer .js-line')"):
            assert time.monotonic() < limit, "the plots were never drawn"
            time.sleep(0.2)
        size = browser.execute_script("return [document.body.scrollWidth, document.documentElement.scrollHeight]")
        assert size[0] <= 1280 and size[1] <= 800
        plots = browser.execute_script(_TEXTS)
        assert len(plots) == 7
        for one in plots:
            left, top, right, bottom = one["div"]
            assert left <= one["title"][0] and one["title"][2] <= right and top <= one["title"][1]
            assert one["below"][3] <= bottom
            assert all(legend[1] >= one["title"][3] for legend in one["legend"])  # below the title
        heads = browser.execute_script(
            "return [...document.querySelectorAll('.words > *')].map((one) => one.getBoundingClientRect().bottom)"
        )
        assert max(heads) <= plots[0]["div"][1] + 1
        photograph(browser, pictures / "page.png")


def test_figure_of_a_log_has_a_title_and_its_titles_fit(log: Path, pictures: Path) -> None:
    assert write_log_figure(log, field_board.mechanism(), pictures / "log.png")
    assert 50_000 < (pictures / "log.png").stat().st_size < 1_000_000
