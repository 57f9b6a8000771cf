"""A recording in words for the user: reasons, kappa and residual in words."""

from __future__ import annotations

import math
import re
from contextlib import suppress

from pvid.base.errors import PvidError
from pvid.link.frames import Code, Core, Form, Hello, Names, Status
from pvid.log.mechanism import mechanism_named
from pvid.log.reader import Account
from pvid.settings.cores import CORES
from pvid.settings.enums import Doubt, Reason, Stage
from pvid.settings.forms import FORMS

_REASONS = {
    Reason.UPDATED: "the estimate was updated",
    Reason.WARMING_UP: "the first window of samples is not full yet",
    Reason.ACCUMULATED: "samples added; the next update follows with the next window",
    Reason.HELD_NOT_EXCITED: "insufficient excitation; the last estimate is held",
    Reason.HELD_SINGULAR: "the equations could not be solved; the last estimate is held",
    Reason.REJECTED_NOT_FINITE: "a sample was not a number and was dropped",
    Reason.REJECTED_OUTLIER: "an outlier was dropped",
    Reason.REJECTED_SATURATED: "a sample beyond all bounds was dropped",
    Reason.HELD_UNCERTAIN: "standard errors too large, or not converged; the last trusted estimate is held",
    Reason.HELD_OUT_OF_RANGE: "a sample exceeded the range of its signal; the window was dropped",
    Reason.HELD_FROZEN: "frozen: new data are ignored",
    Reason.NOT_READY: "the identifier has no configuration, or refused it",
    Reason.HELD_SEARCHING: "refinement: no block of samples fits the equations yet",
    Reason.HELD_BLOCK: "refinement: the block does not fit the equations, or contradicts those before it",
    Reason.HELD_DISAGREES: "refinement: it differs from the weak form by more than the errors of both",
    Reason.MISFIT: "the estimate was updated, but residuals exceed the sensors' noise: friction, large angles or "
    "another mechanism",
}

# What the core publishes (trust.h), and what a good drive reaches (theory.md 4).
KAPPA_MIN, KAPPA_WEAK, KAPPA_GOOD = 3e-5, 1e-3, 5e-3
_KAPPA_SHOWN = (1e-6, 1.0)


_DOUBTS = {
    Doubt.CONTRADICTED: "the present data give another one",
    Doubt.GREW: "its standard errors have grown",
    Doubt.MISFIT: "residuals exceed the sensors' noise",
    Doubt.REJECTS: "many windows are rejected as outliers",
    Doubt.CHANGED: "the mechanism has changed",
    Doubt.AGED: "nothing has confirmed it for long",
}


def standing_words(standing: str) -> str:
    """Whether the published estimate still holds, and why not, from the words of the table (record.standing_text)."""
    for cause, words in _DOUBTS.items():
        standing = standing.replace(cause.text, words)
    return standing


def stage_words(stage: str, reason: str) -> str:
    """Whose estimate is published (Stage.text), and why, by the reason of the refinement's last block; empty without a
    second stage."""
    if not stage:
        return ""
    words = reason_words(reason).removeprefix("refinement: ")
    if stage == Stage.REFINED.text:
        return "the second stage's" + (f"; of the last block: {words}" if reason != Reason.UPDATED.text else "")
    return f"the first stage's; the second: {words}"


def board_words(hello: Hello | None, account: Account) -> str:
    """Who the board is, and what it does if it does not simply run."""
    if hello is None:
        return "has not described itself yet"
    form, core = (
        kinds(number).name.lower() if number in list(kinds) else str(number)
        for kinds, number in ((Form, hello.form), (Core, hello.core))
    )
    of = _mechanism(account) if hello.form == Form.WEAK else f"{form} form"
    arithmetic = CORES[core].words if core in CORES else core
    text = f"{hello.board}: {of}, {arithmetic}, {hello.sample_rate:g} samples per second"
    status = account.lasting.get(Status)
    if isinstance(status, Status) and status.code != Code.RUNNING and status.code in list(Code):
        text += f"; {Code(status.code).name.lower().replace('_', ' ')}"
    return text


def _mechanism(account: Account) -> str:
    """As the board named it last."""
    names = account.lasting.get(Names)
    with suppress(PvidError):
        if isinstance(names, Names):
            return mechanism_named(names.text).name
    return "an unnamed mechanism"


def link_words(account: Account) -> tuple[bool, str]:
    """Whether the link is up, and how it is."""
    if not account.segments:
        return False, "opening"
    last = account.segments[-1]
    if last.why is None:
        return True, f"up, segment {last.number}"
    if not account.obstacle and re.search("^ended|are over$|have come$", last.why):
        return True, f"finished: {last.why}"
    return False, f"down: {account.obstacle or last.why}"


def received_words(account: Account, samples: float, received: float) -> str:
    """What came, and `samples` and `received` bytes a second."""
    rates = (f" ({samples:.0f} per second)", f" ({received / 1e3:.1f} kB/s)") if received else ("", "")
    return f"{account.samples} samples{rates[0]}, {account.bytes / 1e6:.2f} MB{rates[1]}"


def loss_words(account: Account) -> str:
    """What was lost; empty when nothing was."""
    parts = [
        (account.missing_samples, "samples"),
        (account.missing, "frames"),
        (account.damaged, "damaged pieces"),
        (account.foreign, "foreign frames"),
    ]
    losses = ", ".join(f"{count} {what}" for count, what in parts if count)
    lost = f"{losses} ({100 * account.lost_share:.2g} %)" if losses else ""
    unread = f"{account.unread / 1e6:.1f} MB recorded, but too fast to be decoded" if account.unread else ""
    return "; ".join(filter(None, (lost, unread)))


def reason_words(reason: str) -> str:
    """What a reason (Reason.text) means, in a sentence; empty for one of another version."""
    return next((words for one, words in _REASONS.items() if one.text == reason), "")


def kappa_words(kappa: float) -> str:
    """Identifiability of the parameters from the data, in words."""
    if not kappa >= KAPPA_MIN:
        return "parameters not identifiable"
    if kappa < KAPPA_WEAK:
        return "weak: parameters barely identifiable"
    return ("fair" if kappa < KAPPA_GOOD else "good") + ": parameters identifiable"


def kappa_share(kappa: float) -> float:
    """Length of kappa's bar, 0 to 1, over the decades from 1e-6 to 1."""
    low, high = (math.log10(one) for one in _KAPPA_SHOWN)
    if not kappa > 0:
        return 0.0
    return min(1.0, max(0.0, (math.log10(kappa) - low) / (high - low)))


def residual_words(hello: Hello | None) -> str:
    """What the residuals are so many times of."""
    if hello is not None and hello.form == Form.WEAK:
        return "times the noise of the sensors"
    weak = hello is not None and FORMS[hello.form_name].publishes
    return "times the encoder's noise" if weak else "times the row_sd that was configured"
