"""pvid replaces the files that it wrote, as it wrote them, and nothing else."""

from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result

from pvid.base import replacing
from pvid.base.atomic_write import write_files, write_whole
from pvid.base.errors import PvidError
from pvid.cli.main import GROUPS, commands
from pvid.fleet.page import Fleet, page

REFUSED = "is not replaced: pvid did not write it, or it was changed since"


@pytest.fixture(autouse=True)
def account(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An account of its own, whose list of written files is empty."""
    place = tmp_path / "account"
    place.mkdir()
    monkeypatch.setattr(replacing, "private_folder", lambda: place)
    return place


def pvid(*arguments: str | Path) -> Result:
    return CliRunner().invoke(commands, [str(one) for one in arguments], standalone_mode=False)


def forgotten(account: Path) -> None:
    """As on another machine."""
    (account / "written").unlink()


def test_what_was_written_is_replaced_until_somebody_changes_it(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    for text in ("first", "second", "third"):
        write_whole(path, text)
    path.write_text("third!")
    with pytest.raises(PvidError, match=f"a.txt {REFUSED}"):
        write_whole(path, "fourth")
    assert path.read_text() == "third!"
    with replacing.replacing():
        write_whole(path, "fourth")
    write_whole(path, "fifth")
    assert path.read_text() == "fifth"


def test_a_copy_on_another_machine_is_somebodys_and_the_same_content_is_no_change(
    tmp_path: Path, account: Path
) -> None:
    path = tmp_path / "a.txt"
    write_whole(path, "first")
    forgotten(account)
    write_whole(path, "first")
    with pytest.raises(PvidError, match=REFUSED):
        write_whole(path, "second")


def test_an_empty_file_and_a_cache_are_replaced(tmp_path: Path) -> None:
    path = tmp_path / "made by mktemp"
    path.touch()
    write_whole(path, "new")
    path.write_text("somebody's")
    write_whole(path, "new", freely=True)
    assert path.read_text() == "new"


def test_of_several_files_none_is_written_where_one_is_somebodys(tmp_path: Path) -> None:
    (tmp_path / "b.c").write_text("int mine;")
    with pytest.raises(PvidError, match=f"b.c {REFUSED}"):
        write_files(tmp_path, {"a.c": "int a;", "b.c": "int b;"})
    assert not (tmp_path / "a.c").exists()


def test_the_list_of_written_files_is_of_bounded_length(
    tmp_path: Path, account: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replacing, "_MOST", 400)
    path = tmp_path / "a.txt"
    for number in range(50):
        write_whole(path, f"text {number}")
    assert (account / "written").stat().st_size <= 400
    assert all(len(line) > 32 for line in (account / "written").read_text().splitlines())


def test_without_a_list_files_are_written_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replacing, "private_folder", lambda: Path("/proc/none"))
    write_whole(tmp_path / "a.txt", "first")
    with pytest.raises(PvidError, match=REFUSED):
        write_whole(tmp_path / "a.txt", "second")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A simulated run with its rig file."""
    path = tmp_path / "keep.csv"
    assert pvid("model", "simulate", "dc_motor", path, "--duration", "3").exception is None
    return path


def simulation_again(run: Path, *more: str) -> Result:
    return pvid("model", "simulate", "dc_motor", run, "--duration", "3", "--seed", "5", *more)


def test_a_simulation_replaces_itself_and_no_hand_written_rig_file(run: Path) -> None:
    assert simulation_again(run).exception is None
    rig, before = run.with_suffix(".toml"), run.read_bytes()
    own = rig.read_text().replace("1000.0", "999.0")
    rig.write_text(own)
    refused = pvid("model", "simulate", "dc_motor", run, "--duration", "3", "--seed", "6")
    assert f"keep.toml {REFUSED}" in str(refused.exception)
    assert (rig.read_text(), run.read_bytes()) == (own, before)
    assert simulation_again(run, "--force").exception is None and rig.read_text() != own


def test_the_pendulums_simulation_replaces_no_file_of_somebody_either(tmp_path: Path) -> None:
    rig = tmp_path / "keep.toml"
    rig.write_text("l1 = 0.3\n")
    refused = pvid("simulate", tmp_path / "keep.csv", "--duration", "2")
    assert f"keep.toml {REFUSED}" in str(refused.exception) and not (tmp_path / "keep.csv").exists()
    rig.unlink()
    (tmp_path / "keep.csv").write_text("t,phi,y\n")
    refused = pvid("simulate", tmp_path / "keep.csv", "--duration", "2")
    assert f"keep.csv {REFUSED}" in str(refused.exception)


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_a_figure_replaces_figures_of_pvid_on_any_machine_and_nothing_else(
    tmp_path: Path, account: Path, run: Path, suffix: str
) -> None:
    from matplotlib.figure import Figure

    from pvid.base.figure_file import save

    figure, path = Figure(), tmp_path / f"figure.{suffix}"
    figure.subplots().plot([1, 2])
    save(figure, path, 50)
    forgotten(account)
    figure.subplots().plot([2, 1])
    save(figure, path, 50)
    figure.savefig(path, dpi=50)
    with pytest.raises(PvidError, match=REFUSED):
        save(figure, path, 60)
    path.unlink()
    path.symlink_to(run)
    before = run.read_bytes()
    refused = pvid("identify", run, "--figure", path)
    assert "is a link to" in str(refused.exception) and run.read_bytes() == before and not refused.output


def test_a_page_of_a_fleet_is_known_by_its_generator(tmp_path: Path, account: Path) -> None:
    write_whole(tmp_path / "page.html", page(Fleet.of([]), "a"))
    forgotten(account)
    write_whole(tmp_path / "page.html", page(Fleet.of([]), "b"))
    (tmp_path / "page.html").write_text("<p>mine</p>")
    with pytest.raises(PvidError, match=REFUSED):
        write_whole(tmp_path / "page.html", page(Fleet.of([]), "c"))


def test_generated_code_replaces_its_former_self_and_no_hand_written_file(tmp_path: Path, account: Path) -> None:
    folder = tmp_path / "built"
    assert pvid("model", "build", "dc_motor", "-o", folder, "--functions", "8").exception is None
    forgotten(account)
    assert pvid("model", "build", "dc_motor", "-o", folder, "--functions", "9").exception is None
    (folder / "dc_motor.h").write_text("int mine;\n")
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    refused = pvid("model", "build", "dc_motor", "-o", folder, "--functions", "8")
    assert f"dc_motor.h {REFUSED}" in str(refused.exception)
    assert before == {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_every_command_that_writes_a_file_has_force() -> None:
    writers, names = set(), [name for group in GROUPS.values() for name in group if name != "bench"]
    context = click.Context(commands)
    found = {name: commands.get_command(context, name) for name in names}
    found |= {f"model {name}": one for name, one in found["model"].commands.items()}  # type: ignore[union-attr]
    for name, command in found.items():
        options = {one.name for one in command.params}  # type: ignore[union-attr]
        if options & {"out", "figure", "rig_out", "page"}:
            writers.add(name)
            assert "force" in options or name == "log", name  # a log replaces nothing
    assert writers >= {"simulate", "identify", "plot", "batch", "export", "layout", "deploy", "demo", "model build"}
