"""Any mechanism on a board, in either arithmetic: recorded, verified by the twin, exported under its own names."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mechanisms import BOARDS, Board, board_of_mechanism, core_record, path_of, samples_in_si
from own_mechanisms import OWN, TICKS
from program import pvid

from pvid.base.errors import PvidError
from pvid.board.field import collect
from pvid.board.mechanism_board import MechanismBoard, board_of
from pvid.board.mechanism_board_q31 import MechanismBoardQ31
from pvid.board.stream_image import settings_number
from pvid.board.target import HOST_TARGET, judge, open_target, verify
from pvid.core.native import Native
from pvid.link.frames import Code, Core, Estimate, EstimateQ31, Form, Raw, Source
from pvid.log.export import export_log
from pvid.log.reader import LogReader
from pvid.log.recorder import EmulatorSource, Logger
from pvid.log.rig import mechanism_of_log, recording_of_log, settings_text_of_log
from pvid.log.verify import Verdict, Verifier
from pvid.models.mechanisms import names
from pvid.show.log_figure import write_log_figure
from pvid.show.page_state import LiveState

DAMAGES = {
    "dc_motor": (("estimator_law", "estimator_lore"), ("design_hop", "design_hip"), ("dc_motor", "nowhere")),
    "kapitza": (("estimator_gain", "estimator_gait"), ("design_hop", "design_hip"), ("jet_reach", "jet")),
}


@pytest.fixture(scope="module")
def motor() -> MechanismBoard:
    board = board_of_mechanism("dc_motor")
    assert isinstance(board, MechanismBoard)
    return board


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Of boards on this machine, recorded as they are asked for."""
    folder = tmp_path_factory.mktemp("logs")

    class Logs(dict[str, Path]):
        def __missing__(self, name: str) -> Path:
            self[name] = folder / f"{name}.pvlog"
            _record(board_of_mechanism(name), self[name])
            return self[name]

    return Logs()


def _record(board: Board, out: Path) -> None:
    settings = settings_number(board)
    logger = Logger(
        source=EmulatorSource(HOST_TARGET, lambda: open_target(HOST_TARGET, board)),
        out=out,
        rig=board.text(),
        samples=TICKS,
        begin=lambda: board.configure(settings, 100, 100, Source.SENSOR_PACED),
    )
    assert logger.run().samples == TICKS and logger.failures == []


def verifier_of(log: Path) -> Verifier:
    text = settings_text_of_log(log)
    assert text is not None
    return Verifier(board_of(text, path_of(log.stem)))


def read_back(board: Board, model: str | None) -> None:
    text = board.text()
    again = board_of(text, model)
    assert type(again) is type(board) and again.text() == text and len(text) < 64_000
    assert settings_number(again) == settings_number(board) and again.names == board.names
    assert again.names.parse(board.names.text.encode()) == board.names


@pytest.mark.parametrize("name", names())
def test_text_in_a_log_gives_the_same_board_back(name: str) -> None:
    read_back(MechanismBoard.of_shipped_rig(name), None)


@pytest.mark.parametrize("name", ["battery_2rc", *BOARDS])
def test_text_of_a_board_in_integers_gives_it_back(name: str) -> None:
    shipped = path_of(name) is None
    board = MechanismBoardQ31.of_shipped_rig(name) if shipped else board_of_mechanism(name, MechanismBoardQ31)
    read_back(board, path_of(name))


@pytest.mark.parametrize("name", DAMAGES)
def test_text_that_is_damaged_is_refused(name: str) -> None:
    text = board_of_mechanism(name).text()
    assert board_of("l1 = 0.3\n") is None
    for wrong, right in DAMAGES[name]:
        assert wrong in text
        with pytest.raises(PvidError):
            board_of(text.replace(wrong, right))


@pytest.mark.parametrize(
    ("name", "target", "fixed"),
    [
        *((one, HOST_TARGET, kind is MechanismBoardQ31) for one, kind in BOARDS.items()),
        ("free_pendulum", "mps2-an386", False),
        ("heated_plate", "mps2-an386", True),
        ("mass_chain", "mps2-an386", False),
        ("mass_chain", "mps2-an386", True),
    ],
)
def test_a_board_computes_the_bits_of_this_machine(name: str, target: str, fixed: bool) -> None:
    board = board_of_mechanism(name, MechanismBoardQ31 if fixed else MechanismBoard)
    with open_target(target, board) as opened:
        record = collect(opened, TICKS, begin=board, hash_every=600, estimate_every=1200)
    own, kind = core_record(board), (Core.Q31 if fixed else Core.F32)
    assert record.hello is not None
    assert (record.hello.form, record.hello.core, record.hello.samples) == (Form.WEAK, kind, board.recording.shape[1])
    assert record.status is not None and record.status.code == Code.RUNNING and record.gaps == []
    sent = np.concatenate([record.raw[first] for first in sorted(record.raw)])
    assert np.array_equal(sent[:TICKS], board.recording)
    assert len(record.hashes) >= 5
    for tick, found in record.hashes.items():
        assert found == own.hash[tick - 1], tick
    estimate = record.estimates[2400]
    assert isinstance(estimate, Estimate if kind == Core.F32 else EstimateQ31)
    assert estimate.p[: len(board.p_names)] == tuple(own.published[2399].tolist())


def test_samples_that_the_pc_sends_have_the_bits_of_this_machine(motor: MechanismBoard, native: Native) -> None:
    board = motor.without_recording
    verdict = verify(HOST_TARGET, board, native, *motor.recording.T)
    assert verdict.text == "equal" and verdict.playback.done == TICKS and len(verdict.playback.hashes) == TICKS // 500
    other = motor.recording.copy()
    other[1200, 1] += np.float32(0.01)  # the block sums of a step round away a change of the last bit
    found = judge(verdict.playback, board.hashes(native, *other.T))
    assert found.first is not None and found.first[0] >= 1000 and "DIFFERENT" in found.text


@pytest.mark.parametrize("name", BOARDS)
def test_log_is_verified_and_exported_under_the_mechanisms_names(
    name: str, logs: dict[str, Path], tmp_path: Path
) -> None:
    board, log = board_of_mechanism(name), logs[name]
    (stretch,) = verifier_of(log).stretches(LogReader(log))
    verdict = Verdict()
    verdict.add(stretch)
    assert stretch.difference is None and verdict.verified == TICKS and verdict.checked == 2 * TICKS // 100
    assert "no check of them" not in stretch.text
    mechanism = mechanism_of_log(log)
    assert board.names.parameters == mechanism.parameters
    paths = export_log(log, "csv", tmp_path / "a", mechanism)
    samples = list(csv.DictReader(paths[0].open()))
    signals = [one for one, _ in board.names.samples]
    found = np.array([[float(row[one]) for one in signals] for row in samples])
    assert np.allclose(found, samples_in_si(board), rtol=1e-6, atol=1e-9)
    last = list(csv.DictReader(paths[1].open()))[-1]
    for one, published in zip(board.p_names, core_record(board).published[-1], strict=True):
        scale = 1.0 if isinstance(board, MechanismBoard) else board.weak.values(np.ones(len(board.p_names)))
        value = float(published) * np.broadcast_to(scale, len(board.p_names))[board.p_names.index(one)]
        assert float(last[one]) == pytest.approx(value, rel=1e-6) and float(last[f"{one}_se"]) > 0


def test_a_log_in_integers_is_a_recording_for_identify(logs: dict[str, Path], tmp_path: Path) -> None:
    done = pvid(tmp_path, "identify", str(logs["heated_plate"]), "--json", "--model", str(OWN["heated_plate"].path))
    answer = json.loads(done.stdout)
    assert done.returncode == 0 and answer["samples"] == TICKS, done.stderr
    assert answer["parameters"]["C"]["value"] == pytest.approx(100.0, rel=0.01)


def test_a_changed_sample_and_a_changed_estimate_are_found(logs: dict[str, Path]) -> None:
    verifier, records = verifier_of(logs["dc_motor"]), list(LogReader(logs["dc_motor"]))
    at = next(i for i, one in enumerate(records) if isinstance(one.item, Raw) and one.tick > 1000)
    raw = records[at].item
    assert isinstance(raw, Raw)
    changed = bytes([raw.data[0] ^ 1]) + raw.data[1:]
    wrong = [*records[:at], replace(records[at], item=replace(raw, data=changed)), *records[at + 1 :]]
    (stretch,) = verifier.stretches(wrong)
    assert stretch.difference is not None and stretch.difference.variable == "hash of the samples"
    at = next(i for i, one in enumerate(records) if isinstance(one.item, Estimate) and one.tick == 2000)
    estimate = records[at].item
    assert isinstance(estimate, Estimate)
    p = (*estimate.p[:2], float(np.nextafter(np.float32(estimate.p[2]), np.float32(1))), *estimate.p[3:])
    wrong = [*records[:at], replace(records[at], item=replace(estimate, p=p)), *records[at + 1 :]]
    (stretch,) = verifier_of(logs["dc_motor"]).stretches(wrong)
    assert stretch.difference is not None and stretch.difference.variable == "k"


def test_samples_of_another_number_a_tick_are_not_verified(logs: dict[str, Path]) -> None:
    records = [
        replace(one, item=Raw(one.item.data[: 8 * one.item.count], session=one.item.session))
        if isinstance(one.item, Raw)
        else one
        for one in LogReader(logs["dc_motor"])
    ]
    verdict = Verdict()
    for stretch in verifier_of(logs["dc_motor"]).stretches(records):
        verdict.add(stretch)
        assert stretch.why_not is not None and "2 a tick, and the identifier takes 3" in stretch.why_not
    assert verdict.verified == 0 and verdict.samples == TICKS


def test_signals_of_a_log_are_read_by_name(logs: dict[str, Path], motor: MechanismBoard) -> None:
    recording = recording_of_log(logs["dc_motor"], ["phi", "V"])
    assert np.array_equal(np.float32(recording.signals["V"]), motor.recording[:, 0])
    assert list(recording.signals) == ["phi", "V"] and recording.sample_rate == 1000.0
    with pytest.raises(PvidError, match="a log of dc_motor: it has V, i and phi, and not x"):
        recording_of_log(logs["dc_motor"], ["x"])


def test_page_shows_the_names_and_units_of_the_mechanism(logs: dict[str, Path]) -> None:
    state = LiveState(logs["dc_motor"], "the motor")
    data = logs["dc_motor"].read_bytes()
    for first in range(0, len(data), 5000):
        state.take(data[first : first + 5000])
    shown = json.loads(state.as_json())
    assert ": dc_motor, float32" in shown["board"] and shown["lost"] == ""
    assert [row["name"] for row in shown["parameters"]] == ["R", "L", "k", "J", "b", "Tc", "i0"]
    assert [row["unit"] for row in shown["parameters"]][:4] == ["Ω", "mH", "mN·m/A", "×10⁻⁴ kg·m²"]
    assert [curve["label"] for curve in shown["motion"]] == ["V [V]", "i [A]", "phi [rad]"]
    assert [len(curve["x"]) > 100 for curve in shown["motion"]] == [True] * 3
    assert len(shown["estimates"]["curves"]) == 7 and "noise of the sensors" in shown["residual"]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("dc_motor", ("Tc [mN·m]", "phi [rad]", "excitation of R", ": dc_motor, float32", f"{TICKS} samples")),
        ("heated_plate", ("C [J/K]", "T [K]", f"{TICKS} samples")),
    ],
)
def test_log_is_plotted(name: str, words: tuple[str, ...], logs: dict[str, Path], tmp_path: Path) -> None:
    out = tmp_path / "log.svg"
    write_log_figure(logs[name], mechanism_of_log(logs[name]), out)
    drawn = out.read_text()
    for one in words:
        assert f"<!-- {one}" in drawn or one in drawn, one


def test_options_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    for given, why in ((["--paced"], "an emulated board needs a mechanism"), (["--refine"], "needs a mechanism")):
        done = pvid(tmp_path, "log", HOST_TARGET, "a.pvlog", *given)
        assert done.returncode == 2 and why in done.stderr
    (tmp_path / "rig.toml").write_text('[model]\nname = "dc_motor"\n')
    done = pvid(tmp_path, "log", HOST_TARGET, "a.pvlog", "--rig", "rig.toml")
    assert done.returncode == 2 and "sample_rate is required" in done.stderr
    assert not (tmp_path / "a.pvlog").exists()
