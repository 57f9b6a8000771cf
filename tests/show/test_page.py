"""The live page: in a browser, beside a recording that it can neither slow nor end."""

import json
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import field_board
import numpy as np
import pytest
from browser import chromium
from click.testing import CliRunner
from conftest import ROOT
from logs import log_of
from processes import PATIENCE_S, until
from selenium import webdriver

from pvid.base.errors import PvidError
from pvid.cli.main import commands
from pvid.log.file import LogWriter
from pvid.log.reader import LogReader
from pvid.show.page import is_local, listen, page
from pvid.show.page_state import LiveState

TICKS = 12_000
PLOTS = ("parameter0", "parameter1", "parameter2", "residualPlot", "kappaPlot", "signal0", "signal1")


@pytest.fixture(scope="module")
def sent() -> list[bytes]:
    """The frames of a run of TICKS with ten estimates a second."""
    return list(field_board.frames(field_board.messages(field_board.Field(TICKS, estimate_every=100))))


def get(address: str, path: str = "", host: str | None = None) -> bytes:
    """What the server answers."""
    request = urllib.request.Request(address + path, headers={} if host is None else {"Host": host})
    with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
        return bytes(answer.read())


def received(address: str) -> str:
    """The page's text about it; empty while the server is too busy."""
    try:
        return str(json.loads(get(address, "state"))["received"])
    except urllib.error.URLError:
        return ""


def state_of(log: bytes, title: str = "") -> dict[str, Any]:
    """The page's state after these bytes of a log."""
    state = LiveState(Path("nowhere"), title)
    state.take(log)
    return dict(json.loads(state.as_json()))


# ---- where it is served


@pytest.mark.parametrize("at", ["", "8765", "localhost", "localhost:", "a b:1", "127.0.0.1:70000", "::1:80", "/dev/x"])
def test_invalid_address_is_refused(at: str) -> None:
    with pytest.raises(PvidError, match="--web takes HOST:PORT, as in 127.0.0.1:8765"):
        listen(at)


def test_an_address_that_is_taken_is_refused_and_port_0_is_any() -> None:
    listening, address = listen("127.0.0.1:0")
    with listening:
        port = listening.getsockname()[1]
        assert address == f"http://127.0.0.1:{port}/"
        with pytest.raises(PvidError, match=f"cannot serve the live page at 127.0.0.1:{port}"):
            listen(f"127.0.0.1:{port}")


def test_local_addresses() -> None:
    assert all(is_local(f"http://{host}:1/") for host in ("127.0.0.1", "localhost", "[::1]"))
    assert not any(is_local(f"http://{host}:1/") for host in ("0.0.0.0", "[::]", "192.168.1.2", "lab"))


def test_the_page_listens_on_the_loopback_alone_and_answers_no_other_name(tmp_path: Path) -> None:
    with page("127.0.0.1:0", tmp_path / "none.pvlog", "title") as address:
        until(lambda: _answers(address))
        port = int(address.rstrip("/").rsplit(":", 1)[1])
        others = [info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)]
        for other in {str(one) for one in others} - {"127.0.0.1"}:
            if not other.startswith("127."):
                with pytest.raises(OSError):
                    socket.create_connection((other, port), timeout=2)
        with pytest.raises(urllib.error.HTTPError, match="400"):
            get(address, "state", host="evil.example")
        assert json.loads(get(address, "state", host=f"localhost:{port}"))["title"] == "title"
        assert b"<title>pvid log</title>" in get(address)
    assert not _answers(address)


def test_a_page_for_the_network_answers_numbers_and_its_own_names_alone(tmp_path: Path) -> None:
    with page("0.0.0.0:0", tmp_path / "none.pvlog", "title") as address:
        there = address.replace("0.0.0.0", "127.0.0.1")
        until(lambda: _answers(there))
        name = socket.gethostname()
        for own in ("192.0.2.7:8765", "[2001:db8::1]:80", "localhost", name, f"{name}.local"):
            assert json.loads(get(there, "state", host=own))["title"] == "title"
        for foreign in ("evil.example", "evil.example:1", "192.0.2.7.evil.example", "", "a b", "[evil]", "localhost.a"):
            with pytest.raises(urllib.error.HTTPError, match="400"):
                get(there, "state", host=foreign)


def _answers(address: str) -> bool:
    try:
        return bool(get(address, "state"))
    except (urllib.error.URLError, OSError):
        return False


def test_the_page_ends_with_the_program_however_that_goes(tmp_path: Path) -> None:
    code = (
        "import time; from pathlib import Path; from pvid.show.page import page\n"
        "with page('127.0.0.1:0', Path('none'), '') as address: print(address, flush=True); time.sleep(60)"
    )
    program = subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path, stdout=subprocess.PIPE, text=True)
    assert program.stdout is not None
    address = program.stdout.readline().strip()
    until(lambda: _answers(address))
    program.kill()
    program.communicate()
    until(lambda: not _answers(address))


def test_log_refuses_an_address_before_it_records(tmp_path: Path) -> None:
    arguments = ["log", "nowhere", str(tmp_path / "out.pvlog"), "--web", "here"]
    with pytest.raises(PvidError, match="--web takes HOST:PORT"):
        CliRunner().invoke(commands, arguments, standalone_mode=False, catch_exceptions=False)
    assert not (tmp_path / "out.pvlog").exists()


# ---- what it says


def test_the_state_is_that_of_the_log_and_bounded(sent: list[bytes], tmp_path: Path) -> None:
    log_of(tmp_path / "a.pvlog", b"".join(sent), rig=field_board.text(), why=None)
    log = (tmp_path / "a.pvlog").read_bytes()
    state = state_of(log, "a title")
    assert state["title"] == "a title" and state["up"] and state["lost"] == ""
    assert f"{TICKS} samples" in state["received"] and "kapitza, float32" in state["board"]
    assert state["reason"] == "updated" and state["kappa"].endswith("good: parameters identifiable")
    assert [row["name"] for row in state["parameters"]] == ["g", "l2", "rho2", "w", "d1", "d2", "c"]
    estimates = state["estimates"]
    assert len(estimates["t"]) == TICKS // 100
    g = estimates["curves"][0]
    assert g["label"] == "g [m/s²]"
    assert g["low"][-1] < 9.5 < g["high"][-1] and g["limits"][0] < g["value"][-1] < g["limits"][1]
    run, motion = field_board.Field(TICKS).run, {one["label"]: one for one in state["motion"]}
    assert max(motion["phi [rad]"]["x"]) == pytest.approx(run.phi[2000:TICKS].max(), rel=1e-6)
    assert min(motion["y [mm]"]["x"]) == pytest.approx(1e3 * run.y[2000:TICKS].min(), rel=1e-6)
    assert state["motion"][0]["t"][-1] == pytest.approx(TICKS / 1000, abs=0.03)
    ended = log_of(tmp_path / "b.pvlog", b"".join(sent), why="40 s are over")
    state = state_of(ended.read_bytes())
    assert state["up"] and state["link"] == "finished: 40 s are over" and "per second" not in state["received"]
    longer = state_of(log + 8 * b"".join(sent))
    assert len(longer["estimates"]["t"]) <= 800 and len(longer["motion"][0]["x"]) <= 800
    assert len(json.dumps(longer)) < 250_000


def test_every_beginning_of_a_log_has_a_state(sent: list[bytes], tmp_path: Path) -> None:
    log_of(tmp_path / "a.pvlog", b"".join(sent[:200]), why=None)
    log = (tmp_path / "a.pvlog").read_bytes()
    state = LiveState(Path("nowhere"), "")
    for at in range(0, len(log), 101):
        state.take(log[at : at + 101])
        told = json.loads(state.as_json())
        assert [one["label"] for one in told["estimates"]["curves"]] == ["w [1/s²]", "d1", "d2", "c [rad]"]
    noise = np.random.default_rng(1).bytes(50_000) + b"\0"
    assert "damaged pieces" in state_of(log + noise + sent[200])["lost"]


# ---- in a browser


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Path]:
    """A board behind a symbolic link that samples for 40 s, in time."""
    place = tmp_path / "board"
    playing = field_board.Board(place, 40_000, estimate_every=100, per_second=1000)
    yield place
    playing.kill()


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[webdriver.Chrome]:
    """A window at about:blank."""
    with chromium(tmp_path / "chromium", 1500, 1150) as driver:
        driver.get("about:blank")
        requests_of(driver)  # those of the browser's own first page
        yield driver


def requests_of(browser: webdriver.Chrome) -> list[str]:
    """Addresses that were asked for since the last call."""
    events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]  # type: ignore[no-untyped-call]
    return [
        str(event["params"]["request"]["url"]) for event in events if event["method"] == "Network.requestWillBeSent"
    ]


def drawn(browser: webdriver.Chrome, plot: str) -> list[dict[str, Any]]:
    """What uPlot holds of a plot: the last value and the points of each curve, its label, pixels with ink."""
    script = """
        const plot = plots.get(arguments[0]);
        if (!plot || !plot.chart) { return []; }  // not made yet
        const [t, ...curves] = plot.chart.data, canvas = plot.chart.ctx.canvas;
        const pixels = plot.chart.ctx.getImageData(0, 0, canvas.width, canvas.height).data;
        let inked = 0;
        for (let i = 3; i < pixels.length; i += 4) { inked += pixels[i] > 0; }
        return curves.map((x) => ({
            last: x.at(-1), until: t.at(-1), points: x.filter((one) => one !== null && one !== undefined).length,
            title: plot.spec.label, inked}));
    """
    return list(browser.execute_script(script, plot))


def complaints(browser: webdriver.Chrome) -> list[str]:
    """What the browser said of the page, but for a hint at how `drawn` reads its pixels."""
    said = [str(one["message"]) for one in browser.get_log("browser")]  # type: ignore[no-untyped-call]
    return [one for one in said if "willReadFrequently" not in one and "will-read-frequently" not in one]


def test_the_page_moves_in_a_browser_and_asks_nobody_else(
    tmp_path: Path, board: Path, browser: webdriver.Chrome
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        at = f"127.0.0.1:{free.getsockname()[1]}"
    command = [sys.executable, "-m", "pvid", "log", "board", "out.pvlog", f"--web={at}"]
    logger = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        until(lambda: _answers(f"http://{at}/"))
        browser.get(f"http://{at}/")
        until(lambda: all(drawn(browser, plot) and drawn(browser, plot)[-1]["points"] > 20 for plot in PLOTS))
        first = {plot: drawn(browser, plot) for plot in PLOTS}
        before = browser.execute_script("return received.textContent")
        until(lambda: drawn(browser, "signal0")[0]["until"] > first["signal0"][0]["until"] + 3)
        for plot in PLOTS:
            now = drawn(browser, plot)
            assert all(one["inked"] > 1000 for one in now), plot
            assert now[-1]["until"] > first[plot][-1]["until"], plot
        assert browser.execute_script("return received.textContent") != before
        assert drawn(browser, "parameter0")[0]["title"].startswith("w [")  # the log has no rig file
        words = browser.find_element("tag name", "body").text
        assert "board -> out.pvlog" in words and "samples per second" in words and "nothing" in words
        assert browser.execute_script("return alarm.hidden") is True
        asked = requests_of(browser)
        assert any(one.endswith("/uplot.js") for one in asked)
        assert all(one.startswith((f"http://{at}/", "data:", "blob:")) for one in asked), set(asked)
        assert complaints(browser) == []
        logger.send_signal(signal.SIGINT)
        out, err = logger.communicate(timeout=PATIENCE_S)
        assert logger.returncode == 0, err
        assert f"live page: http://{at}/" in err
        until(lambda: browser.execute_script("return !alarm.hidden"))
        assert "has ended" in browser.find_element("id", "alarm").text
    finally:
        logger.kill()
        logger.communicate()
    reader = LogReader(tmp_path / "out.pvlog")
    assert list(reader) and reader.account.lost_share == 0


@pytest.fixture(scope="module")
def finished(sent: list[bytes], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log whose recording has ended."""
    path = tmp_path_factory.mktemp("finished") / "a.pvlog"
    return log_of(path, b"".join(sent), rig=field_board.text(), why=None)


@pytest.mark.parametrize(
    ("scheme", "width", "height"),
    [
        ("dark", 390, 844),
        *(pytest.param(*one, marks=pytest.mark.night) for one in (("light", 1280, 800), ("dark", 1920, 1080))),
    ],
)
def test_a_finished_log_fits_every_screen_and_scheme(
    tmp_path: Path, finished: Path, width: int, height: int, scheme: str
) -> None:
    with page("127.0.0.1:0", finished, "a.pvlog") as address, chromium(tmp_path / "chromium", width, height) as browser:
        media = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
        until(lambda: _answers(address))
        browser.get(address)
        until(lambda: all(drawn(browser, plot) for plot in PLOTS))
        until(lambda: len(drawn(browser, "signal1")) == 2)  # what the estimate predicts, beside what was measured
        assert browser.execute_script("return document.documentElement.scrollWidth <= innerWidth")
        # One script: the page replaces its tiles at any time.
        shown = (
            "const tile = document.querySelector('.tile b'); return [tile.innerText, tile.getBoundingClientRect().y]"
        )
        text, y = browser.execute_script(shown)
        assert text.startswith("9.5") and y < height / 3
        cut = """const {chart} = one, axis = chart.axes[1];
            chart.ctx.font = axis.font[0];
            const longest = Math.max(...axis._values.map((text) => chart.ctx.measureText(text).width));
            return longest / devicePixelRatio > axis._size - 8;"""
        assert browser.execute_script(f"return [...plots.values()].filter((one) => {{ {cut} }}).length") == 0
        back = browser.execute_script("return getComputedStyle(document.body).backgroundColor")
        assert (sum(map(int, re.findall(r"\d+", back)[:3])) < 200) == (scheme == "dark")
        table = browser.execute_script("return asCsv(plots.get('parameter0'))").splitlines()
        assert table[0] == '"t [s]","estimate","−2 s.e.","+2 s.e."' and len(table) == 1 + TICKS // 100
        browser.find_element("id", "pause").click()
        assert browser.execute_script("return paused") is True
        assert complaints(browser) == []


def test_the_plots_share_a_cursor_and_a_time_range_and_are_saved(tmp_path: Path, finished: Path) -> None:
    with page("127.0.0.1:0", finished, "a.pvlog") as address, chromium(tmp_path / "chromium", 1280, 800) as browser:
        until(lambda: _answers(address))
        browser.get(address)
        until(lambda: all(drawn(browser, plot) for plot in PLOTS))
        browser.find_element("id", "pause").click()

        def asked(expression: str) -> Any:
            return browser.execute_script(f"const x = plots.get('signal0').chart.scales.x; return {expression}")

        whole = asked("x.max - x.min")
        browser.execute_script("plots.get('signal0').chart.setCursor({left: 100, top: 50}, true, true)")
        until(lambda: browser.execute_script("return plots.get('parameter0').chart.cursor.idx") is not None)
        browser.execute_script(
            "const last = new Option('last 5 s', '5'); place('range').add(last); last.selected = true;"
            "place('range').dispatchEvent(new Event('change'))"
        )
        assert whole > 8 and asked("x.max - x.min") == pytest.approx(5.0)
        assert browser.execute_script("return marks.t.length") > 0  # of windows that were rejected or held
        saved: dict[str, str] = browser.execute_async_script("""
            const [done] = arguments, names = {}, real = HTMLAnchorElement.prototype.click;
            HTMLAnchorElement.prototype.click = function () { names[this.download] = this.href.slice(0, 40); };
            document.querySelectorAll("#signal0 button").forEach((one) => one.click());
            HTMLAnchorElement.prototype.click = real;
            done(names);""")
        assert saved["signal0.png"].startswith("data:image/png;base64,iVBOR") and saved["signal0.csv"].startswith(
            "blob:"
        )
        assert complaints(browser) == []


def test_state_of_a_log_names_withheld_windows_and_what_the_estimate_predicts(finished: Path) -> None:
    log = finished.read_bytes()
    state = LiveState(finished, "")
    state.take(log)
    first = json.loads(state.as_json())
    assert "modelled" not in first["motion"][1] and first["modelled"] == ""
    assert first["marks"]["t"] and not any(first["marks"]["rejected"])
    assert all(t < 12 for t in first["marks"]["t"])
    assert [row["name"] for row in first["parameters"] if row["large"]] == ["g", "l2", "rho2"]
    then = until(lambda: (now := json.loads(state.as_json())) and now["modelled"] and now)
    assert then["modelled"].startswith("phi to ") and "R^2 0.99" in then["modelled"]
    measured, modelled = (np.array(then["motion"][1][name], float) for name in ("x", "modelled"))
    there = np.isfinite(modelled)
    assert there.sum() > 0.5 * there.size and np.std((measured - modelled)[there]) < 0.1 * np.std(measured)


def test_view_refuses_what_is_no_log(tmp_path: Path) -> None:
    path = tmp_path / "a.pvlog"
    for content, sentence in ((None, "No such file"), (b"t,phi,y\n0,0,0\n" * 100, "a.pvlog")):
        if content is not None:
            path.write_bytes(content)
        with pytest.raises((PvidError, OSError), match=sentence):
            CliRunner().invoke(commands, ["view", str(path)], standalone_mode=False, catch_exceptions=False)


def test_view_serves_a_log_until_it_is_interrupted(finished: Path) -> None:
    command = [sys.executable, "-m", "pvid", "view", str(finished), "--web", "127.0.0.1:0"]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert program.stdout is not None
    line = program.stdout.readline()
    until(lambda: f"{TICKS} samples" in received(line.split()[0]))
    program.send_signal(signal.SIGINT)
    assert program.wait(20) == 0


@pytest.mark.parametrize(
    ("name", "shown"), [("former_motor_weak", "What the board published"), ("", "There is no report")]
)
def test_the_page_has_a_report_of_what_is_recorded(name: str, shown: str, tmp_path: Path) -> None:
    log = tmp_path / "run.pvlog"
    if name:
        log.write_bytes((ROOT / "tests" / "data" / "logs" / f"{name}.pvlog").read_bytes())
    with page("127.0.0.1:0", log, "a log") as address:
        assert b'href="report"' in get(address)
        try:
            text = get(address, "report")
        except urllib.error.HTTPError as error:
            assert error.code == 422
            text = error.read()
    assert shown in text.decode() and ("Parts of the error" in text.decode()) == bool(name)


def test_ports_lists_the_emulated_boards() -> None:
    listed = CliRunner().invoke(commands, ["ports"], standalone_mode=False, catch_exceptions=False).output
    assert all(name in listed for name in ("mps2-an386", "microbit", "stream-host"))


def test_browsers_that_never_read_their_answers_cost_the_log_nothing(tmp_path: Path, sent: list[bytes]) -> None:
    """Twenty connections that ask and do not listen, while the log grows; another one is served all the same."""
    writer = LogWriter(tmp_path / "a.pvlog")
    with page("127.0.0.1:0", tmp_path / "a.pvlog", "") as address:
        until(lambda: _answers(address))
        port = int(address.rstrip("/").rsplit(":", 1)[1])
        deaf = [socket.create_connection(("127.0.0.1", port)) for _ in range(20)]
        for one in deaf:
            one.sendall(200 * f"GET /uplot.js HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        writer.begin("a port", None)
        began = time.monotonic()
        for frame in sent:
            writer.take(frame)
        lasted = time.monotonic() - began
        writer.close()
        until(lambda: f"{TICKS} samples" in received(address))
        for one in deaf:
            one.close()
    assert lasted < TICKS / 1000  # in less than the time in which they come
