"""The bench of the choices of a build: each is there, and a smaller build is smaller."""

import pytest

from bench.build_choices import CHOICES, HEADER, Choice, footprint_of


def test_each_choice_has_a_title_of_its_own_core_and_stage() -> None:
    assert len({(one.core, one.refined, one.title) for one in CHOICES}) == len(CHOICES)
    assert len(HEADER) == 5


@pytest.mark.night
@pytest.mark.slow
def test_a_build_for_little_flash_has_less_text_and_takes_more_instructions() -> None:
    printed = footprint_of(Choice("as printed"), 0)
    small = footprint_of(Choice("-Os", options={"CMAKE_BUILD_TYPE": "MinSizeRel"}), 1)
    assert small.text < 0.95 * printed.text and small.mean > printed.mean and small.bss == printed.bss
