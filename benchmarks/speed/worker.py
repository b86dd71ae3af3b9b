"""The process that measures: started in a peer's environment, told by lines of JSON what to do.

    python -P worker.py MODULE

MODULE has a table ROWS of functions, each of which prepares a row: it takes the row's settings as
keywords and returns a `Prepared`. After loading it the worker says

    {"ready": true, "versions": {"numpy": "2.4.6", ...}}

and then answers each request, a line, with a line:

    {"prepare": KEY, "row": FUNCTION, "settings": {...}}    {"prepared": SECONDS}
    {"measure": KEY, "seconds": 0.5}                        {"steps": N, "seconds": S, "facts": {}}

or, in place of either answer, {"missing": WHY} for what cannot be measured here and
{"error": WHY} for what failed. It ends when its input does.
"""

import importlib
import json
import os
import signal
import sys
import time
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any, TextIO

ROOT = Path(__file__).resolve().parents[2]


def main(name: str) -> None:
    """Serve the rows of a module until the input ends."""
    # Ctrl-C is for the process that started this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # What a library prints is no answer: it goes where errors go.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    sys.path.insert(0, str(ROOT))
    from benchmarks.speed.loops import Missing, Prepared

    def say(answer: Mapping[str, Any]) -> None:
        print(json.dumps(answer), file=answers, flush=True)

    try:
        module = importlib.import_module(name)
    except Exception as error:
        say({"error": in_words(error)})
        return
    say({"ready": True, "versions": versions(getattr(module, "PACKAGES", ()))})
    prepared: dict[str, Prepared] = {}
    for request in requests(sys.stdin):
        try:
            if "prepare" in request:
                begin = time.perf_counter()
                prepared[request["prepare"]] = module.ROWS[request["row"]](**request["settings"])
                prepared[request["prepare"]].chunk()
                say({"prepared": time.perf_counter() - begin})
            else:
                say(measured(prepared[request["measure"]], request["seconds"]))
        except Missing as reason:
            say({"missing": str(reason)})
        except Exception as error:
            say({"error": in_words(error)})


def measured(row: Any, seconds: float) -> dict[str, Any]:  # noqa: ANN401 - a Prepared
    """Steps in a time (s), in whole chunks; how long they took, and the row's facts."""
    steps, begin = 0, time.perf_counter()
    while True:
        steps += row.chunk()
        elapsed = time.perf_counter() - begin
        if elapsed >= seconds:
            return {"steps": steps, "seconds": elapsed, "facts": dict(row.facts())}


def requests(lines: TextIO) -> Any:  # noqa: ANN401 - an iterator of what JSON holds
    """Parse requests from lines of an input."""
    for line in lines:
        yield json.loads(line)


def versions(packages: tuple[str, ...]) -> dict[str, str]:
    """Versions of Python and of installed packages."""
    return {"python": sys.version.split()[0]} | {name: metadata.version(name) for name in packages}


def in_words(error: BaseException) -> str:
    """An error on one line."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


if __name__ == "__main__":
    main(sys.argv[1])
