"""One tool on the recordings of a folder, in a process of the environment that has it: a line of JSON a recording."""

from __future__ import annotations

import importlib
import json
import logging
import resource
import sys
import time
import warnings
from pathlib import Path

import numpy as np

from bench.peers.arm import arm_rig
from bench.peers.rigs import RIGS


def main(tool: str, rig: str, folder: Path, seconds: float, most: int) -> None:
    """Fits until the processor's seconds are used up; killed by the system at `most`."""
    resource.setrlimit(resource.RLIMIT_CPU, (most, most + 1))
    logging.disable()
    warnings.simplefilter("ignore")
    peer = importlib.import_module(f"bench.peers.{tool}")
    mechanism = RIGS.get(rig) or arm_rig(folder)
    used = 0.0
    for path in sorted(folder.glob("*.npz"), key=lambda path: int(path.stem)):
        if used > seconds:
            break
        run = dict(np.load(path))
        begin = time.process_time()
        try:
            values, errors, said = peer.fit(mechanism, run, mechanism.guess(int(path.stem)))
        except Exception as error:  # whatever a tool raises is its answer
            values, errors, said = {}, {}, f"{type(error).__name__}: {error}"
        lasted = time.process_time() - begin
        used += lasted
        numbers = [{name: float(one) for name, one in some.items()} for some in (values, errors)]
        told = {"seed": int(path.stem), "values": numbers[0], "errors": numbers[1], "said": said, "s": lasted}
        print(f"\n{json.dumps(told)}", flush=True)  # on a line of its own: tools print, too


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], Path(sys.argv[3]), float(sys.argv[4]), int(sys.argv[5]))
