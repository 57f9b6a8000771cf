"""The README of a package: one screen."""

from __future__ import annotations

from collections.abc import Sequence

from pvid.deploy import memory
from pvid.deploy.deployment import Deployment
from pvid.deploy.example import expected


def readme(deployment: Deployment, where: str, steps: Sequence[str], notes: Sequence[str] = ()) -> str:
    """README.md.

    Parameters
    ----------
    where : the ecosystem, as in "for Arduino"
    steps : how to build and run the example, one a line
    notes : what is special there
    """
    d = deployment
    names = _named([one.name for one in d.parameters])
    period = f"{1e6 / d.sample_rate:g} us"
    return (
        "\n".join(
            [
                f"# pvid: {d.title}, {where}",
                "",
                f"Identifies {names} of this rig while it runs, each with a standard error:",
                f"{d.arithmetic.samples}, {d.sample_rate:g} samples a second, static memory. Made by `{d.command}`.",
                "",
                "| | sample | unit | |",
                "|---|---|---|---|",
                *(
                    f"| `sample[{k}]` | {one.name} | {one.unit or '1'} | {one.note} |"
                    for k, one in enumerate(d.samples)
                ),
                "",
                "## The example",
                "",
                *(f"{k + 1}. {step}" for k, step in enumerate(steps)),
                "",
                f"It identifies a recorded motion of {len(d.playback.counts) / d.sample_rate:.3g} s and prints",
                "",
                *(f"    {line}" for line in dict.fromkeys(expected(d))),
                "",
                "## Your sensors",
                "",
                f"Call `{d.name}_begin()` once and `{d.name}_step(sample)` every {period}, from a timer;",
                f"samples at irregular times are wrong. The first estimate needs {d.first_s:.3g} s of motion at least.",
                f"`{d.name}_read(value, error)` may be called from any context; `pvid_reason_text(reason)` is why",
                f"there is no estimate yet; `{d.name}_gap()` is for missing samples.",
                f"Delete `{d.name}_example.c` and `.h` then.",
                *_refined(d),
                *_errors(d),
                "",
                *_kept(d),
                "",
                *(f"- {one}" for one in (memory.note(d), _ticks(d), *notes) if one),
                "",
            ]
        ).rstrip()
        + "\n"
    )


def _refined(d: Deployment) -> list[str]:
    """What the second stage is, and how it is left out."""
    if d.second is None:
        return []
    return [
        "",
        f"`{d.name}_begin_refined()` in place of `{d.name}_begin()` switches the second stage on, as the example does:",
        "it fits the full equations, from the first stage's estimate on, to the statistical limit, and",
        f"`{d.name}_read_refined(value, error)` reads its estimate. Without it neither flash nor RAM is taken.",
        *(f"With it the angle of `{d.name}_counted_{x.name}` grows: windows are held out of range." for x in d.turning),
    ]


def _ticks(d: Deployment) -> str:
    """One sentence on time and stack."""
    if d.most is None:
        return "`pvid deploy --ticks N` bounds the instructions of a tick and the stack on a Cortex-M4F."
    return (
        f"On a Cortex-M4F (gcc -O2) a tick of the first stage takes at most {d.most.bound} instructions without "
        f"interrupts, by its code (firmware.md, Guarantees), and took {d.most.longest} in a search with spoilt "
        f"samples; the stack is at most {d.most.stack} bytes."
    )


def _kept(d: Deployment) -> list[str]:
    """How the values survive the life of a program."""
    return [
        f"The values survive an update: `while ((status = {d.name}_save(record)) == PVID_RECORD_MORE) {{}}` fills",
        f"{d.record_bytes} bytes, a piece a call; write them to your flash if it ends with `PVID_RECORD_DONE`. In",
        f"the next life `{d.name}_load(record)` behind `{d.name}_begin()` makes them the start, whatever its release",
        "and settings; a record that is damaged or of other parameters is refused with a reason.",
    ]


def _errors(d: Deployment) -> list[str]:
    """What the standard errors contain, and the doubts about the recording."""
    out = []
    if d.causes:
        whose = " of the first stage; those of the second contain noise alone" if d.second is not None else ""
        out += ["", f"A longer run does not reduce these parts of the standard errors{whose}:", ""]
        out += [f"- {one}" for one in d.causes]
    if d.warnings:
        out += ["", "The analysis of the recording says:", "", *(f"- {one}" for one in d.warnings)]
    return out


def _named(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
