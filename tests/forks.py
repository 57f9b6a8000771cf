"""Imports what the commands of pvid import, compiles the model that most of them use, and for each line of standard
input executes a command in a fork of itself.

A line is JSON: folder, words of the command, and the files for its standard output and standard error. What is printed
for each is the exit code. tests/program.py starts it.
"""

import gc
import json
import os
import signal
import sys
from importlib import import_module

from pvid.cli.main import main
from pvid.models.mechanisms import compiled_of

IMPORTED = [
    *(f"pvid.cli.{name}" for name in ("compare", "export", "identify", "log", "model", "simulate", "verify")),
    *("pvid.identification.road", "pvid.identification.judge", "pvid.identification.core"),
    *("scipy.integrate", "scipy.interpolate", "scipy.signal"),
]
TIMEOUT_S = 300


def next_command() -> bool:
    """Prepares this process for a command, as a fork; False: there is none left."""
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            folder, words, *printed = json.loads(line)
            os.chdir(folder)
            for descriptor, path in enumerate((os.devnull, *printed)):
                file = os.open(path, os.O_RDWR | os.O_CREAT)
                os.dup2(file, descriptor)
                os.close(file)
            sys.argv = ["pvid", *words]
            signal.alarm(TIMEOUT_S)  # ends it
            return True
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)
    return False


if __name__ == "__main__":
    for name in IMPORTED:
        import_module(name)
    compiled_of("kapitza")
    gc.collect()
    gc.freeze()
    if next_command():
        main()
