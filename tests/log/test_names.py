"""A log by the names that the board gave, of another mechanism and of a liar; and one of a former schema."""

import csv
from pathlib import Path

import numpy as np
import pytest
from lies import NAMED
from logs import log_of
from lying_board import PER_FRAME, LyingBoard, message

from pvid.base.errors import PvidError
from pvid.link import frames as link
from pvid.link.names import BoardNames, Quantity
from pvid.log.export import export_log
from pvid.log.history import History
from pvid.log.mechanism import TAKEN, UNNAMED, mechanism_named
from pvid.log.reader import LogReader, Record
from pvid.log.rig import mechanism_of_log
from pvid.log.values import Values, tables_of
from pvid.log.verify import Verifier

MOTOR = b"motor\nsample V V\nsample i A\nsample phi rad\np R ohm\np k N*m/A\np i0"
OLD = Path(__file__).parents[1] / "data" / "logs" / "two_samples.pvlog"


def of_motor(board: LyingBoard, first: int = 0, ticks: int = PER_FRAME) -> bytes:
    """Samples 0.1, 0.2, 0.3 and an estimate 1, 2, 3 with standard errors 0.1, 0.2, 0.4."""
    samples = link.Raw.of_values([0.1] * ticks, [0.2] * ticks, [0.3] * ticks)
    covariance = link.upper_triangle(np.diag([0.01, 0.04, 0.16]))
    estimate = board.estimate(p=(1.0, 2.0, 3.0, *[0.0] * 5), covariance=covariance)
    return board.say(samples, first) + board.say(estimate, first + ticks)


def test_names_survive_the_way() -> None:
    names = BoardNames.parse(MOTOR)
    assert names.text.encode() == MOTOR
    assert names.samples == (("V", "V"), ("i", "A"), ("phi", "rad"))
    assert names.parameters == (("R", "ohm"), ("k", "N*m/A"), ("i0", ""))
    samples, p = (tuple(Quantity(f"{one}{i:031d}", "u" * 24) for i in range(8)) for one in "sp")
    longest = BoardNames("m" * 32, samples, p)
    assert BoardNames.parse(longest.text.encode()) == longest


@pytest.mark.parametrize("text", NAMED[:-3])
def test_a_lie_about_names_is_refused(text: bytes) -> None:
    with pytest.raises(PvidError) as refused:
        mechanism_named(text)
    assert str(refused.value).isprintable() and len(str(refused.value)) < 200


def test_samples_in_another_order_are_those_of_the_mechanism(tmp_path: Path) -> None:
    """The identifier takes the pendulum's height first."""
    board = LyingBoard()
    text = b"kapitza\nsample y m\nsample phi rad\np w 1/s^2\np d1\np d2\np c rad"
    names = board.say(message(link.Names, text=text))
    log = log_of(tmp_path / "a.pvlog", board.say(board.hello()) + names + board.say(board.samples(phi=0.1, y=0.2)))
    samples = list(csv.DictReader(export_log(log, "csv", tmp_path / "a", mechanism_of_log(log))[0].open()))
    assert [float(samples[3][name]) for name in ("phi", "y")] == pytest.approx([0.1, 0.2])


def test_columns_that_a_log_has_are_taken() -> None:
    tables = tables_of(UNNAMED)
    own = {one.name for one in (*UNNAMED.samples, *UNNAMED.answers)}
    common = {name for table in ("samples", "estimates") for name in tables[table]} - own
    assert TAKEN == {name for name in common if not name.endswith("_se")}


def test_log_of_another_mechanism_is_exported_under_its_names(tmp_path: Path) -> None:
    board = LyingBoard()
    hello = board.hello(form=2, n_p=3, samples=3, phi_lsb=0.0, y_lsb=0.0)
    names = board.say(message(link.Names, text=MOTOR))
    log = log_of(
        tmp_path / "a.pvlog", board.say(hello) + names + of_motor(board) + board.say(board.samples(), PER_FRAME)
    )
    mechanism = mechanism_of_log(log)
    assert mechanism.name == "motor"
    paths = export_log(log, "csv", tmp_path / "a", mechanism)
    samples = list(csv.DictReader(paths[0].open()))
    assert [float(samples[7][name]) for name in ("V", "i", "phi")] == pytest.approx([0.1, 0.2, 0.3])
    assert samples[PER_FRAME]["V"] == "nan"  # two samples a tick are not those of the motor
    (estimate,) = csv.DictReader(paths[1].open())
    assert [float(estimate[name]) for name in ("R", "k", "i0")] == [1.0, 2.0, 3.0]
    assert [float(estimate[f"{name}_se"]) for name in ("R", "k", "i0")] == pytest.approx([0.1, 0.2, 0.4])
    assert '"unit": "N*m/A"' in paths[4].read_text()


def test_view_follows_the_names_and_forgets_what_went_before() -> None:
    board, history = LyingBoard(), History()
    with_names = board.say(message(link.Names, text=MOTOR))
    sent = [
        board.say(board.hello()),
        board.say(board.samples()),
        with_names,
        of_motor(board),
        of_motor(board, PER_FRAME),
    ]
    frames = [one for one in link.Decoder().feed(b"".join(sent)) if isinstance(one, link.Frame)]
    for frame in frames[:2]:
        history.take(Record(0, 1, frame.tick, frame.message))
    assert history.samples().shape == (3, PER_FRAME) and history.mechanism is UNNAMED
    for frame in frames[2:]:
        history.take(Record(0, 1, frame.tick, frame.message))
    assert history.mechanism.name == "motor" and history.samples().shape == (4, 2 * PER_FRAME)
    assert history.newest["k"] == 2.0 and history.estimates("k").tolist() == [2.0, 2.0]
    assert history.is_physical and not history.mechanism.outputs


def test_values_with_a_rig_do_not_follow_the_board(tmp_path: Path) -> None:
    board = LyingBoard()
    log = log_of(tmp_path / "a.pvlog", board.say(board.hello()) + board.say(message(link.Names, text=MOTOR)))
    values = Values()
    assert [list(values.rows(record)) for record in LogReader(log)] and values.mechanism is UNNAMED


def test_log_of_the_former_schema_is_exported(tmp_path: Path) -> None:
    """Its board had the former weak form of the pendulum, which no twin computes any more."""
    (stretch,) = Verifier(None).stretches(LogReader(OLD))
    assert stretch.ticks == 1000 and not stretch.verified
    assert stretch.why_not is not None and "no settings of an identifier" in stretch.why_not
    paths = export_log(OLD, "csv", tmp_path / "old", mechanism_of_log(OLD))
    samples = list(csv.DictReader(paths[0].open()))
    assert len(samples) == 1000 and abs(float(samples[0]["phi"])) < 1.0
    last = list(csv.DictReader(paths[1].open()))[-1]
    assert float(last["w"]) > 0 and float(last["l2"]) > 0
