"""`pvid demo MODEL`: either core, its twin and a board agree, beside the truth."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from pvid.base.console import DONE
from pvid.base.errors import PvidError
from pvid.board.target import HOST_TARGET
from pvid.cli.mechanism_demo import demo


def test_a_mechanism_is_identified_compared_and_streamed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert demo("battery_2rc", HOST_TARGET, "this machine", 0, tmp_path / "a.png") == DONE
    told = capsys.readouterr().out
    assert (
        told.count("equal in every bit, hash") == 2 and told.count("streamed to this machine: 14400 ticks, equal") == 2
    )
    assert "C in float32" in told and "C in fixed point" in told and "truth" in told
    assert (tmp_path / "a.png").stat().st_size > 10_000


@pytest.mark.parametrize("answered", [True, False])
def test_what_the_equations_neglect_is_printed_once_behind_both_cores(
    answered: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def identified(*_: object) -> None:
        if not answered:
            raise PvidError("no answer")

    same = SimpleNamespace(equal=True, twin_hash=0, ticks=1, text="equal", playback=SimpleNamespace(done=1))
    monkeypatch.setattr("pvid.cli.mechanism_demo.identify_in_c", identified)
    monkeypatch.setattr("pvid.cli.mechanism_demo.identify_mechanism", lambda *_: SimpleNamespace(ranking=()))
    for name in ("_print", "convergence"):
        monkeypatch.setattr(f"pvid.cli.mechanism_demo.{name}", lambda *_: None)
    for name in ("compare_recording", "verify_recording"):
        monkeypatch.setattr(f"pvid.cli.mechanism_demo.{name}", lambda *_: same)
    demo("kapitza", HOST_TARGET, "this machine", 0, tmp_path / "a.png")
    told = capsys.readouterr().out
    assert told.count("small-angle equations neglect (phi^2)") == answered
    assert not answered or told.index("neglect") > told.rindex("streamed to")


def test_what_is_not_shipped_is_refused() -> None:
    with pytest.raises(PvidError, match="there is no shipped mechanism own; there are "):
        demo("own", HOST_TARGET, "this machine", 0, Path("a.png"))
