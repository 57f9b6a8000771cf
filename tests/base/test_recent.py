"""What is kept of the last few arguments is made once for equal ones."""

from pvid.base.recent import Recent


def test_equal_arguments_share_a_result_as_long_as_they_are_among_the_last() -> None:
    made: list[list[int]] = []

    def doubled(given: list[int]) -> list[int]:
        made.append(given)
        return [2 * one for one in given]

    recent = Recent(doubled, kept=2)
    first = recent([1])
    assert first == [2] and recent([1]) is first  # equal, not the same object
    recent([2])
    assert recent([1]) is first and made == [[1], [2]]
    recent([3])  # [2] was asked for longest ago
    assert recent([1]) is first
    recent([2])
    assert made == [[1], [2], [3], [2]]
