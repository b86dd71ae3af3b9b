"""The other end of `worker`: starts its process, asks, and never waits for ever."""

import json
import os
import queue
import signal
import subprocess
import tempfile
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.speed.loops import Missing
from benchmarks.speed.peers import ROOT

WORKER = Path(__file__).resolve().parent / "worker.py"

START_S = 120.0
"""Longest time that a worker may take to load its packages (s)."""

PREPARE_S = 600.0
"""Longest time to prepare a row (s): compilation, and reference solutions."""

OVERTIME_S = 120.0
"""How much longer than asked for a measurement may take (s): one chunk of a slow row."""

_END_S = 2.0
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""What holds libraries to one thread, unless a row asks them for more."""


class WorkerError(RuntimeError):
    """A worker that died, hung or failed; the message says what it last said."""


class StartError(WorkerError):
    """A worker that could not be started: none of its rows can be measured."""


class Client:
    """A worker's process, started when it is first asked and again after it died.

    Args:
        python: interpreter that runs it.
        module: what it serves, such as `benchmarks.speed.workers.serve_classic`.

    Attributes:
        versions: of Python and its packages, once it has started.
    """

    def __init__(self, python: Path, module: str) -> None:
        self._command = [str(python), "-P", str(WORKER), module]
        self._process: subprocess.Popen[str] | None = None
        self._prepared: set[str] = set()
        self.versions: dict[str, str] = {}

    def prepare(self, key: str, row: str, settings: Mapping[str, Any]) -> None:
        """Have a row made ready, if it is not.

        Raises:
            Missing: it cannot be measured here.
            StartError: the worker cannot be started.
            WorkerError: the worker failed.
        """
        if self._process is None:
            self._start()
        if key not in self._prepared:
            self._ask({"prepare": key, "row": row, "settings": settings}, PREPARE_S)
            self._prepared.add(key)

    def measure(self, key: str, seconds: float) -> dict[str, Any]:
        """Steps, seconds and facts of a prepared row, measured for a while (s).

        Raises:
            Missing: it cannot be measured here.
            WorkerError: the worker failed.
        """
        return self._ask({"measure": key, "seconds": seconds}, seconds + OVERTIME_S)

    def end(self) -> None:
        """End the process: by closing its input, then by force."""
        process, self._process = self._process, None
        self._prepared.clear()
        if process is None:
            return
        assert process.stdin is not None
        try:
            process.stdin.close()
        except OSError:
            pass  # It is dead already.
        try:
            process.wait(_END_S)
        except subprocess.TimeoutExpired:
            _kill(process)
            process.wait()
        self._errors.close()

    def _start(self) -> None:
        self._errors = tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace")
        self._process = subprocess.Popen(
            self._command,
            cwd=ROOT,
            env=os.environ | dict.fromkeys(_ONE_THREAD, "1"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            # Ctrl-C is for this process, which ends the others.
            start_new_session=True,
        )
        self._prepared.clear()
        self._answers: queue.SimpleQueue[str] = queue.SimpleQueue()
        threading.Thread(target=self._listen, args=(self._process,), daemon=True).start()
        try:
            self.versions = self._answer(START_S, "to start")["versions"]
        except WorkerError as error:
            self.end()
            raise StartError(str(error)) from None

    def _listen(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        answers = self._answers
        with process.stdout as lines:
            for line in lines:
                answers.put(line)
        answers.put("")

    def _ask(self, request: Mapping[str, Any], limit: float) -> dict[str, Any]:
        assert self._process is not None and self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
        except OSError:
            pass  # It is dead; what it left says why.
        return self._answer(limit, "to answer")

    def _answer(self, limit: float, what: str) -> dict[str, Any]:
        try:
            line = self._answers.get(timeout=limit)
        except queue.Empty:
            self.end()
            raise WorkerError(f"took longer than {limit:g} s {what}") from None
        try:
            answer = json.loads(line)
        except ValueError:
            raise WorkerError(self._death(line)) from None
        if "missing" in answer:
            raise Missing(answer["missing"])
        if "error" in answer:
            raise WorkerError(answer["error"])
        return answer

    def _death(self, said: str) -> str:
        """How the process ended, and its last words."""
        process = self._process
        assert process is not None
        if said:
            self.end()
            return f"gave an answer that is none: {said.strip()[:100]!r}"
        code = process.wait()
        self._errors.seek(0)
        words = [line.strip() for line in self._errors if line.strip()][-1:]
        self.end()
        how = f"ended by signal {-code}" if code < 0 else f"ended with exit code {code}"
        return ": ".join([f"its process {how}", *words])


def _kill(process: subprocess.Popen[str]) -> None:
    """End a process and those that it started."""
    try:
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
    except (ProcessLookupError, PermissionError):
        pass
