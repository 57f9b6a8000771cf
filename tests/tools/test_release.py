"""tools/release refuses what is no release, and packs what is committed."""

import json
import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "tools"))

import release  # noqa: E402 - of tools

HEADER = "firmware/include/pvid/version.h"
PACKAGE = "host/src/pvid/base/version.py"
CHANGELOG = "host/docs/changelog.md"


def git(*arguments: str, cwd: Path) -> str:
    who = ("-c", "user.name=a", "-c", "user.email=a@b")
    return subprocess.run(["git", *who, *arguments], cwd=cwd, capture_output=True, text=True, check=True).stdout


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A repository of the files that have the version, 1.2.3."""
    root = tmp_path / "project"
    numbers = zip(("MAJOR", "MINOR", "PATCH"), "123", strict=True)
    texts = {
        HEADER: "".join(f"#define PVID_VERSION_{name} {value}\n" for name, value in numbers),
        PACKAGE: '__version__ = "1.2.3"\n',
        CHANGELOG: "# Changelog\n\n## 1.2.3\n\n- new\n\n## 1.2.2\n",
    }
    for name, text in texts.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")
    git("init", "-q", cwd=root)
    git("add", "-A", cwd=root)
    git("commit", "-qm", "all", cwd=root)
    return root


def replace(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def test_a_release_passes_both_checks(project: Path) -> None:
    release.check_tree(project)
    release.check_versions(project)
    assert release.version_of_header(project) == "1.2.3"


def test_a_change_in_no_section_is_refused_by_its_file(project: Path) -> None:
    release.check_changes(project)
    changes, name = project / ".github" / "changes", "+rig-columns.fixed"
    changes.mkdir(parents=True)
    (changes / "README.md").write_text("How.\n", encoding="utf-8")
    release.check_changes(project)
    (changes / f"{name}.md").write_text("More.\n", encoding="utf-8")
    with pytest.raises(release.RefusalError, match=rf"{re.escape(name)}\S+ is in no section .* there are 1"):
        release.check_changes(project)


@pytest.mark.parametrize(("name", "old", "new"), [(PACKAGE, "1.2.3", "1.2.4"), (CHANGELOG, "## 1.2.3", "## 1.3.0")])
def test_another_version_is_refused_by_its_file(name: str, old: str, new: str, project: Path) -> None:
    replace(project / name, old, new)
    with pytest.raises(release.RefusalError, match=re.escape(name)) as refused:
        release.check_versions(project)
    assert "1.2.3" in str(refused.value) and str(refused.value).count(".\n") == 0


def test_the_header_alone_is_refused_as_well(project: Path) -> None:
    replace(project / HEADER, "PATCH 3", "PATCH 4")
    with pytest.raises(release.RefusalError, match=r"has 1\.2\.3 .* has 1\.2\.4"):
        release.check_versions(project)


@pytest.mark.parametrize("name", ["new.c", PACKAGE])
def test_what_no_commit_has_is_refused(name: str, project: Path) -> None:
    (project / name).write_text("something\n", encoding="utf-8")
    with pytest.raises(release.RefusalError, match=re.escape(name)):
        release.check_tree(project)


def test_this_clone_has_one_version_and_the_lines_that_the_sdist_replaces() -> None:
    assert release.version_of_header(ROOT) == release.version_of_python(ROOT)
    assert release.version_of_changelog(ROOT) == release.version_of_header(ROOT)
    text = (ROOT / "host" / "pyproject.toml").read_text(encoding="utf-8")
    assert [text.count(upward) for upward in release._UPWARD] == [1] * len(release._UPWARD)


def test_the_archive_has_what_is_committed_and_nothing_else(project: Path, tmp_path: Path) -> None:
    (project / "not-committed").write_text("", encoding="utf-8")
    replace(project / PACKAGE, "1.2.3", "9.9.9")
    archive = release.source_archive(project, "1.2.3", tmp_path)
    with tarfile.open(archive) as tar:
        files = {member.name for member in tar if member.isfile()}
    committed = git("ls-tree", "-r", "--name-only", "HEAD", cwd=project).split()
    assert archive.name == "pvid-1.2.3-source.tar.gz" and files == {f"pvid-1.2.3/{name}" for name in committed}
    (tmp_path / "out").mkdir()
    assert release.version_of_python(release.extracted(archive, tmp_path / "out")) == "1.2.3"


def test_sha256sum_accepts_the_checksums_and_finds_a_changed_byte(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("b.zip", "a.whl")]
    for path in paths:
        path.write_bytes(path.name.encode())
    (tmp_path / "SHA256SUMS").write_text(release.checksums(paths), encoding="utf-8")
    check = ["sha256sum", "--check", "--strict", "SHA256SUMS"]
    accepted = subprocess.run(check, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert accepted.returncode == 0 and accepted.stdout.split() == ["a.whl:", "OK", "b.zip:", "OK"]
    paths[0].write_bytes(b"b.zap")
    assert subprocess.run(check, cwd=tmp_path, capture_output=True, check=False).returncode == 1


def test_equal_files_make_equal_zips(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name / "src").mkdir(parents=True)
        (tmp_path / name / "src" / "it.c").write_text("int it;\n", encoding="utf-8")
        (tmp_path / f"out-{name}").mkdir()
    first, second = (release.zipped(tmp_path / name, tmp_path / f"out-{name}" / "it.zip") for name in ("one", "two"))
    assert first.read_bytes() == second.read_bytes()
    assert zipfile.ZipFile(first).namelist() == ["it/src/it.c"]


def test_the_bill_of_materials_has_what_the_wheel_contains_and_what_its_requirements_require(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.whl", "w") as wheel:
        wheel.writestr("pvid-1.2.3.dist-info/METADATA", "Requires-Dist: sympy>=1\nRequires-Dist: no; extra == 'x'\n")
        wheel.writestr("pvid/show/web/uplot.js", "/*! uPlot (v1.6.32) */")
    told = json.loads(release.bill_of_materials(tmp_path / "a.whl", "1.2.3", tmp_path).read_text(encoding="utf-8"))
    assert (told["bomFormat"], told["metadata"]["component"]["version"]) == ("CycloneDX", "1.2.3")
    assert [one["name"] for one in told["components"]] == ["uplot", "mpmath", "sympy"]
    assert told["components"][0]["purl"] == "pkg:npm/uplot@1.6.32"


MAIN = 'int it(void);\n#include <stdio.h>\nint main(void) { printf("R = %d +- 1 ohm\\n", it()); return 0; }\n'


@pytest.mark.parametrize(
    ("code", "readme", "refusal"),
    [
        ("int it(void) { return 1; }\n", "    R = 1 +- 1 ohm\n", None),
        ("int it(void) { return x; }\n", "    R = 1 +- 1 ohm\n", r"it\.zip does not compile as C99: .*x"),
        ("int it(void) { return 2; }\n", "    R = 1 +- 1 ohm\n", "other digits than its README"),
        ("int it(void) { return 1; }\n", "It prints R.\n", "other digits than its README"),
        ("int it(void) { return 1; }\n", "    R = 1 +- 1 ohm\n    L = 1 +- 1 H\n", "other digits than its README"),
    ],
)
def test_a_package_is_refused_that_does_not_print_what_its_readme_promises(
    code: str, readme: str, refusal: str | None, tmp_path: Path
) -> None:
    (tmp_path / "p" / "src").mkdir(parents=True)
    (tmp_path / "p" / "src" / "it.c").write_text(code, encoding="utf-8")
    (tmp_path / "p" / "README.md").write_text(readme, encoding="utf-8")
    archive = release.zipped(tmp_path / "p", tmp_path / "it.zip")
    if refusal is None:
        release.check_package(archive, MAIN, tmp_path / "clean")
        return
    with pytest.raises(release.RefusalError, match=refusal) as sentence:
        release.check_package(archive, MAIN, tmp_path / "clean")
    assert "\n" not in str(sentence.value)


@pytest.mark.parametrize(("link", "refused"), [("api/index.html#a", False), ("api/none.html", True)])
def test_pages_with_a_link_to_nothing_are_refused(link: str, refused: bool, tmp_path: Path) -> None:
    (tmp_path / "site" / "api").mkdir(parents=True)
    (tmp_path / "site" / "index.html").write_text(f'<a href="{link}">', encoding="utf-8")
    (tmp_path / "site" / "api" / "index.html").write_text('<a href="../index.html"><a href="#a">', encoding="utf-8")
    archive = release.zipped(tmp_path / "site", tmp_path / "docs.zip")
    if not refused:
        release.check_pages(archive)
        return
    with pytest.raises(release.RefusalError, match=r"api/none\.html"):
        release.check_pages(archive)


def test_a_release_tags_its_commit_once_and_no_other(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for role in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{role}_NAME", "a")
        monkeypatch.setenv(f"GIT_{role}_EMAIL", "a@b")
    for _ in range(2):
        release.check_tag(project)
        release.put_tag(project)
    assert git("cat-file", "-t", "v1.2.3", cwd=project) == "tag\n"
    assert git("rev-parse", "v1.2.3^{}", cwd=project) == git("rev-parse", "HEAD", cwd=project)
    git("commit", "-qm", "more", "--allow-empty", cwd=project)
    with pytest.raises(release.RefusalError, match=r"v1\.2\.3 is the tag of another commit"):
        release.check_tag(project)


def test_the_program_ends_with_one_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(root: Path) -> None:
        raise release.RefusalError("a.c is not committed as it is; of such files there are 1.")

    monkeypatch.setattr(release, "check_tree", refuse)
    monkeypatch.setattr(release, "build", lambda *_: pytest.fail("it went on"))
    assert release.main([]) == 1
    said = capsys.readouterr()
    assert said.err == "release: a.c is not committed as it is; of such files there are 1.\n" and not said.out


def test_a_missing_program_is_named(tmp_path: Path) -> None:
    with pytest.raises(release.RefusalError, match=r"^it does not build: no-such-program is not installed$"):
        release.run("no-such-program", "--build", cwd=tmp_path, failure="it does not build")
