"""The report of an identification: one page for every mechanism and every kind of answer, in the same order."""

import hashlib
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from click.testing import CliRunner
from own_mechanisms import OWN, own_recording

import pvid
from pvid.base.errors import PvidError
from pvid.cli.main import commands
from pvid.models.mechanisms import compiled_of, path_of
from pvid.rig.mechanism_file import channels_of
from pvid.rig.run import write_recording
from pvid.show.report import line_to_type

SHIPPED = {"dc_motor": "8", "kapitza": "20", "battery_2rc": "7200"}  # [s]; the battery has an algebraic equation
OF_THE_METHOD = ("kappa", "chi2", "chi^2", "hash", "weak form", "float64", "law", "window")
SECTIONS = ["Measured against predicted, on data", "What remains", "Parts of the error", "How the values settle", "How"]
VOID = {"meta", "br"}


class Page(HTMLParser):
    """What a browser makes of a page; an element that is not closed is refused."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.words: list[str] = []  # outside of pictures
        self.attributes: list[tuple[str, str | None]] = []
        self.tags: set[str] = set()
        self.headings: list[str] = []
        self.cells: list[list[str]] = []
        self.ids: list[str] = []
        self.feed(text)
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.attributes += attributes
        self.ids += [value for name, value in attributes if name == "id" and value is not None]
        if tag not in VOID:
            self.open.append(tag)
        elif tag == "br" and self.open[-1] == "td":  # below the name of a parameter: what it is
            self.cells[-1][-1] += "\n"
        if tag == "h2":
            self.headings.append("")
        elif tag == "tr":
            self.cells.append([])
        elif tag == "td":
            self.cells[-1].append("")

    def handle_startendtag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.attributes += attributes

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" in self.open or "svg" in self.open:
            return
        self.words.append(data)
        if "h2" in self.open:
            self.headings[-1] += data
        if "td" in self.open:
            self.cells[-1][-1] += data

    @property
    def text(self) -> str:
        return " ".join("".join(self.words).split())

    def row(self, name: str) -> list[str]:
        """The first one whose first cell begins with this line."""
        return next(one for one in self.cells if one and one[0].partition("\n")[0] == name)


def checked(path: Path, but: tuple[str, ...] = ()) -> Page:
    """A page with nothing from elsewhere, and with the words of the method in its last section alone."""
    text = path.read_text(encoding="utf-8")
    page = Page(text)
    for name, value in page.attributes:
        assert name not in ("src", "srcset", "onload", "onclick"), name
        if name in ("href", "xlink:href"):
            assert value is not None and value.startswith("#"), value
    assert not page.tags & {"script", "link", "img", "iframe", "object", "form"}
    assert "url(http" not in text and "@import" not in text
    assert len(page.ids) == len(set(page.ids))
    first, made, _ = page.text.rpartition("How this was made")
    assert made
    for word in OF_THE_METHOD:
        assert word in but or not re.search(rf"\b{re.escape(word)}\b", first), word
    return page


def run_pvid(*words: str | Path) -> Any:
    return CliRunner().invoke(commands, [str(one) for one in words], standalone_mode=False, catch_exceptions=False)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recordings by the names of their mechanisms."""
    folder = tmp_path_factory.mktemp("report")
    for name, seconds in SHIPPED.items():
        run_pvid("model", "simulate", name, folder / f"{name}.csv", "--duration", seconds)
    for name, own in OWN.items():
        write_recording(folder / f"{name}.csv", own_recording(name), channels_of(own.compiled))
    return folder


@pytest.mark.by_day(3)
@pytest.mark.parametrize("name", [*SHIPPED, *OWN])
def test_report_of_every_mechanism_has_the_values_of_the_result_and_all_sections(
    runs: Path, name: str, tmp_path: Path
) -> None:
    model = OWN[name].path if name in OWN else None
    result = pvid.identify(runs / f"{name}.csv", model=model)
    page = checked(result.report(tmp_path / "a.html"))
    kept = iter(page.headings)
    assert all(any(one.startswith(section) for one in kept) for section in SECTIONS), page.headings
    assert result.verdict.capitalize() in page.text
    assert page.text.count("predicts the rest") + page.text.count("predict the rest") == 1
    lost = [one for one, given in result.details["parameters"].items() if given["value"] is None]
    assert all("not identified" in page.row(one) for one in lost), [page.row(one) for one in lost]
    for one_name, one in result.parameters.items():
        row, told = page.row(one_name), one.shown
        assert told is not None and row[1].startswith(told.value) and row[1].endswith(told.unit)
        assert row[2].startswith(f"{told.low} to {told.high}") and row[3] == one.verdict
        low, high = one.interval()
        prefix = 10.0 ** np.round(np.log10(abs(one.value / float(told.value))))
        rounded = float(0.51 * prefix) * 10.0 ** -len(told.low.partition(".")[2])  # half of the last digit
        meaning = row[0].partition("\n")[2]
        assert meaning == ("" if model else compiled_of(name).meanings[one_name])
        assert rounded < 0.05 * (high - low) and float(told.low) * prefix == pytest.approx(low, abs=rounded)
    for sensor in result.unseen.sensors if result.unseen is not None else ():
        assert page.row(sensor.name)[0] == sensor.name
    digest = hashlib.sha256((runs / f"{name}.csv").read_bytes()).hexdigest()
    assert digest in page.text and pvid.__version__ in page.text and f"pvid.identify('{runs / name}.csv'" in page.text


ANSWERS: dict[str, tuple[tuple[str, ...], str]] = {
    "refined": (("--refine",), "Good"),
    "in C": (("--core", "f32"), "Good"),
    "both stages in C": (("--core", "f32", "--refine"), "Good"),
    "in fixed point": (("--core", "q31"), "Good"),
    "strong form": (("--form", "strong"), "Usable"),
}


@pytest.mark.parametrize("kind", ANSWERS)
def test_report_of_every_identifier(runs: Path, kind: str, tmp_path: Path) -> None:
    options, verdict = ANSWERS[kind]
    done = run_pvid("identify", runs / "dc_motor.csv", *options, "--report", tmp_path / "a.html")
    assert done.return_value == 0 and f"report: {tmp_path / 'a.html'}" in done.stdout
    page = checked(tmp_path / "a.html", but=("weak form", "window") if kind == "strong form" else ())
    assert verdict in page.text and page.row("R")[1].endswith("Ω")
    assert ("could not be simulated" in page.text) == (kind == "strong form")


def written(path: Path, **columns: Any) -> Path:
    np.savetxt(path, np.stack(list(columns.values()), 1), "%.9g", ",", header=",".join(columns), comments="")
    return path


def motor(runs: Path) -> dict[str, Any]:
    data = np.genfromtxt(runs / "dc_motor.csv", delimiter=",", names=True)
    return {name: data[name] for name in ("t", "V", "i", "phi")}


def test_report_names_the_missing_term_and_the_line_to_type(
    runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = path_of("dc_motor")[1].read_text(encoding="utf-8")
    text = text.replace(" + Tc * sgn(phi.d())", "").replace(', Tc = model.unknown("J"', ' = model.unknown("J"')
    text = text.replace(', model.unknown("Tc", "N*m", 0.012)', "").replace('Tc="dry friction", ', "")
    (tmp_path / "plain.py").write_text(text, encoding="utf-8")
    words = ["identify", str(runs / "dc_motor.csv"), "--model", str(tmp_path / "plain.py"), "--rig"]
    words += [str(runs / "dc_motor.toml"), "--report", str(tmp_path / "a.html")]
    monkeypatch.setattr("sys.argv", ["pvid", *words])
    run_pvid(*words)
    page = checked(tmp_path / "a.html")
    assert "Usable" in page.text and page.row("b")[3] == "not explained"
    assert "Equation 2 seems to lack" in page.text and page.headings[0].startswith("What is missing")
    assert re.search(r"pvid identify .* --report \S+ --add 'equation 2: a1\*sgn\(phi\.d\(\)\)'", page.text)
    parts = [row for row in page.cells if row and row[0] == "b" and len(row) == 5]
    noise, scale, of_model = (float(one.split()[0]) for one in parts[0][2:])  # in one unit
    assert of_model > 10 * max(noise, scale)


@pytest.mark.parametrize(
    ("advice", "typed"),
    [
        ("V seems to have the opposite sign: --columns V=V:-1 (or i: --columns i=i:-1)", "--columns V=V:-1"),
        ("the recordings differ in m: --own m gives each its own", "--own m"),
        ("phi is read 2 ms later: --set sensor.phi.delay=0.002 corrects it too", "--set sensor.phi.delay=0.002"),
        ("what is named: --add 'equation 1: a1*abs(w)*w' --add a2*w", "--add 'equation 1: a1*abs(w)*w' --add a2*w"),
        ("V is 0 in every sample: is it the column of the drive?", ""),
    ],
)
def test_line_to_type_has_the_options_of_the_advice(advice: str, typed: str) -> None:
    command = "pvid identify 'a run.csv' --report a.html"
    assert line_to_type(command, advice) == (f"{command} {typed}" if typed else "")
    assert line_to_type("pvid.identify('run.csv')", advice) == ""
    if "columns" in typed:
        assert line_to_type(f"{command} --columns t=ms:ms", advice) == ""


def test_report_of_a_recording_that_determines_nothing(runs: Path, tmp_path: Path) -> None:
    good = motor(runs)
    other = written(tmp_path / "other.csv", **{**good, "V": -good["V"]})
    (tmp_path / "other.toml").write_bytes((runs / "dc_motor.toml").read_bytes())
    done = run_pvid("identify", other, "--report", tmp_path / "a.html")
    assert done.return_value == 3
    page = checked(tmp_path / "a.html")
    assert "Not identified" in page.text and "V seems to have the opposite sign" in page.text
    assert "Parts of the error" not in page.headings


def test_report_of_several_recordings_and_of_another_that_was_not_used(runs: Path, tmp_path: Path) -> None:
    good, rig = motor(runs), runs / "dc_motor.toml"
    half = len(good["t"]) // 2
    a, b = (
        written(tmp_path / f"{name}.csv", **{key: one[part] for key, one in good.items()})
        for name, part in (("A", slice(half)), ("<b>B", slice(half, None)))
    )
    run_pvid("identify", a, b, "--rig", rig, "--report", tmp_path / "both.html")
    both = checked(tmp_path / "both.html")
    assert "A.csv and <b>B.csv" in both.text and both.row("R")[3] == "good"
    run_pvid("identify", a, "--rig", rig, "--validate", b, "--report", tmp_path / "other.html")
    other = checked(tmp_path / "other.html")
    assert other.headings[0] == "Measured against predicted: <b>B.csv, another recording"
    assert other.headings[1].startswith(SECTIONS[0])


def test_names_of_anybody_are_text(tmp_path: Path) -> None:
    """Of a file, a column and a model."""
    name = '<script>alert("x")&'
    model = pvid.Model("cart <script>1</script> & ${x}")
    x = model.sensor("x", "m", resolution=1e-5, reach=0.1)
    F = model.input("F", "N", hold="zoh", reach=5)
    m, b = model.unknown("m", "kg", 1.0), model.unknown("b", "N*s/m", 1.0)
    model.equation(m * x.d(2) + b * x.d() - F)
    t = np.arange(4000) / 500
    rng = np.random.default_rng(1)
    force = np.repeat(rng.uniform(-1, 1, 80), 50)
    speed, place = np.zeros(4000), np.zeros(4000)
    for k in range(3999):  # exact for a held force
        end = force[k] + (speed[k] - force[k]) * np.exp(-1 / 500)
        place[k + 1] = place[k] + force[k] / 500 + (speed[k] - force[k]) * (1 - np.exp(-1 / 500))
        speed[k + 1] = end
    data = {"t": t, name: force, "x": np.round(place, 5)}
    result = pvid.identify(data, model=model, columns=f"F={name}:N")
    assert result.identified and abs(result["m"].value - 1) < 4 * result["m"].se
    page = checked(result.report(tmp_path / "a.html"))
    assert "cart <script>1</script> & S(x)" in page.text and "alert" in page.text
    assert "<script" not in (tmp_path / "a.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1440, 820, 390])
@pytest.mark.long
def test_report_fits_the_screen(runs: Path, width: int, scheme: Literal["light", "dark"], tmp_path: Path) -> None:
    from browser import chromium

    path = pvid.identify(runs / "dc_motor.csv").report(tmp_path / "a.html")
    with chromium(tmp_path / "chromium", width, 900) as browser:
        feature = {"name": "prefers-color-scheme", "value": scheme}
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})
        browser.get(path.as_uri())
        assert browser.execute_script("return document.documentElement.scrollWidth") <= width
        light = browser.execute_script("return getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
        assert light == (scheme == "light")
        assert not browser.get_log("browser")  # type: ignore[no-untyped-call]


def test_report_is_no_file_of_somebody_else(runs: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.html").write_text("mine")
    with pytest.raises(PvidError, match="pvid did not write it"):
        run_pvid("identify", runs / "dc_motor.csv", "--report", tmp_path / "mine.html")
    assert (tmp_path / "mine.html").read_text() == "mine"
