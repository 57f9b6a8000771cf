"""What nobody foresaw: one sentence, a report in a file without secrets, and an exit code of its own."""

import sys
from pathlib import Path

import pytest

from pvid.base.crash_report import without_secrets, written
from pvid.cli import main as cli
from pvid.cli.main import main


def _exit_code(error: BaseException, monkeypatch: pytest.MonkeyPatch) -> object:
    def fails(**_: object) -> None:
        raise error

    monkeypatch.setattr(cli.commands, "main", fails)
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code


@pytest.mark.parametrize(
    "error", [AssertionError("x"), RecursionError(), UnicodeEncodeError("ascii", "é", 0, 1, "no"), ZeroDivisionError()]
)
def test_an_unforeseen_error_is_one_sentence_a_report_and_exit_code_70(
    error: Exception, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(sys, "argv", ["pvid", "view", "--token=abcd"])
    assert _exit_code(error, monkeypatch) == 70
    said = capsys.readouterr().err
    assert "Traceback" not in said and said.count("\n") == 1 and type(error).__name__ in said
    (report,) = (tmp_path / "pvid").glob("pvid-error-*.txt")
    assert str(report) in said
    text = report.read_text()
    assert "Traceback" in text and "pvid " in text and "Python" in text and "abcd" not in text


def test_an_interruption_outside_of_a_command_is_exit_code_130(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _exit_code(KeyboardInterrupt(), monkeypatch) == 130


def test_a_report_contains_the_arguments_without_passwords_and_logins() -> None:
    given = ["log", "tcp://me:pw1@host/x", "--password", "pw2", "--token=pw3", "API_KEY=pw4", "--set", "known.l1=0.3"]
    kept = without_secrets(given)
    assert not any(secret in " ".join(kept) for secret in ("pw1", "pw2", "pw3", "pw4"))
    assert kept[0] == "log" and kept[-1] == "known.l1=0.3" and "host/x" in kept[1]


def test_a_report_that_cannot_be_written_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null/a")
    monkeypatch.setenv("HOME", "/dev/null")
    monkeypatch.setattr("tempfile.gettempdir", lambda: "/dev/null")
    assert written(ValueError("x"), []) is None
