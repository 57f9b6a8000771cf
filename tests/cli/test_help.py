"""The help of every command: an example first, 20 lines at most; all of it by --help-all."""

import shlex
from collections.abc import Iterator

import click
import pytest
from in_process import pvid

from pvid.cli.main import commands
from pvid.cli.short_help import EXAMPLES, MOST_LINES

OWN = ("bench",)  # the tool of a clone


def of_group(group: click.Group, words: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    context = click.Context(group)
    for name in group.list_commands(context):
        one = group.get_command(context, name)
        yield from of_group(one, (*words, name)) if isinstance(one, click.Group) else [(*words, name)]


COMMANDS = [words for words in of_group(commands) if words[0] not in OWN]


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_help_is_a_screen_with_an_example_first(words: tuple[str, ...]) -> None:
    shown, whole = (pvid(*words, option).stdout for option in ("--help", "--help-all"))
    usage, blank, example, *_ = shown.splitlines()
    assert usage.startswith("Usage: ") and not blank and example.startswith(f"  pvid {' '.join(words)}")
    assert shown.count("\n") <= MOST_LINES and max(map(len, shown.splitlines())) <= 80
    group: click.Command = commands
    for word in words:
        assert isinstance(group, click.Group)
        group = group.get_command(click.Context(group), word) or group
    assert all(one.opts[0] in whole for one in group.params if isinstance(one, click.Option) and not one.hidden)
    typed = shlex.split(example)[1 + len(words) :]
    parser = group.make_parser(click.Context(group, resilient_parsing=False))
    _, left, _ = parser.parse_args(typed)  # an option that is none is refused
    assert not left


def test_no_example_is_of_a_command_that_is_gone() -> None:
    assert set(EXAMPLES) <= {" ".join(words) for words in COMMANDS}
