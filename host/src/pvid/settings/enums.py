"""Enumerations of the public C headers. Printed by tools/print_headers.py: do not edit."""

from __future__ import annotations

from enum import IntEnum
from typing import Literal

Form = Literal["weak", "strong"]
Core = Literal["f32", "q31"]


class _Named(IntEnum):
    @property
    def text(self) -> str:
        """The name in words."""
        return self.name.lower().replace("_", " ")


class Reason(_Named):
    """Outcome of a tick (pvid_reason)."""

    UPDATED = 0
    WARMING_UP = 1
    ACCUMULATED = 2
    HELD_NOT_EXCITED = 3
    HELD_SINGULAR = 4
    REJECTED_NOT_FINITE = 5
    REJECTED_OUTLIER = 6
    REJECTED_SATURATED = 7
    HELD_UNCERTAIN = 8
    HELD_OUT_OF_RANGE = 9
    MISFIT = 10
    HELD_FROZEN = 11
    NOT_READY = 12
    HELD_SEARCHING = 13
    HELD_BLOCK = 14
    HELD_DISAGREES = 15


class Status(_Named):
    """Analysis of an init (pvid_status)."""

    OK = 0
    BAD_MODEL = 1
    BAD_SAMPLE_RATE = 2
    BAD_BANK = 3
    BAD_START = 4
    BAD_START_SD = 5
    BAD_BOUNDS = 6
    BAD_ROW_SD = 7
    BAD_UPDATE_RATE = 8
    BAD_FORGETTING = 9
    BAD_FEEDBACK = 10
    BAD_LAW = 11
    BAD_DIVIDER = 12
    BAD_STEP_LIMIT = 13
    BAD_KAPPA_MIN = 14
    BAD_CORRELATION = 15
    BAD_DRIVE_MIN = 16
    BAD_ROW_WEIGHT = 17
    BAD_DESIGN = 18
    BAD_ITERATIONS = 19
    BAD_NOISE_MARGIN = 20
    BAD_PUBLISH_KAPPA = 21
    BAD_SE_MAX = 22
    BAD_MISFIT_MAX = 23
    BAD_RANGE = 24
    BAD_GATE_SIGMAS = 25
    BAD_GATE_PATIENCE = 26
    BAD_DEAD_ZONE = 27
    BAD_HALF = 28
    BAD_STRIDE = 29
    BAD_CENTRE = 30
    BAD_TAPS = 31
    BAD_DECIMATION = 32
    BAD_WINDOW = 33
    BAD_FUNCTIONS = 34
    BAD_OVERLAP = 35
    BAD_FULL_SCALE = 36
    BAD_SHIFT = 37
    BAD_DRIVE_TICKS = 38
    BAD_FORMAT = 39
    BAD_RENEWAL = 40
    BAD_SHARED = 41
    BAD_POINTER = 42
    BAD_LAYOUT = 43
    BAD_EXCITE_PARTS = 44
    BAD_EXCITE_AMPLITUDE = 45
    BAD_EXCITE_FREQUENCY = 46
    BAD_EXCITE_LIMIT = 47
    BAD_EXCITE_SLEW = 48
    BAD_EXCITE_TIME = 49
    BAD_EXCITE_GUARD = 50
    BAD_COMMISSION_DRIVES = 51
    BAD_COMMISSION_RING = 52
    BAD_COMMISSION_CHECK = 53


class Stage(_Named):
    """Whose estimate is published (pvid_stage)."""

    WEAK = 0
    REFINED = 1


class Standing(_Named):
    """Whether a published estimate still holds (pvid_standing_state)."""

    NONE = 0
    VALID = 1
    DOUBTED = 2
    WITHDRAWN = 3


class Doubt(_Named):
    """Why it is doubted or withdrawn, one bit each (pvid_doubt)."""

    CONTRADICTED = 1
    GREW = 2
    MISFIT = 4
    REJECTS = 8
    CHANGED = 16
    AGED = 32


class Law(_Named):
    """How the estimate follows the data (pvid_law)."""

    STATIONARY = 0
    PSEUDOVELOCITY = 1


class RecordStatus(_Named):
    """Analysis of a record's save or load (pvid_record_status)."""

    DONE = 0
    MORE = 1
    NOT_VALID = 2
    NO_ROOM = 3
    NONE = 4
    CUT_SHORT = 5
    DAMAGED = 6
    OTHER_FORMAT = 7
    OTHER_MECHANISM = 8
    IMPLAUSIBLE = 9
    NOT_READY = 10


class SnapshotStatus(_Named):
    """Analysis of a snapshot's restore (pvid_snapshot_status)."""

    RESTORED = 0
    NONE = 1
    CUT_SHORT = 2
    DAMAGED = 3
    OTHER_VERSION = 4
    OTHER_KIND = 5
    OTHER_LAYOUT = 6
    OTHER_CONFIG = 7
    NOT_READY = 8
    OTHER_MODEL = 9
    OTHER_DESIGN = 10
