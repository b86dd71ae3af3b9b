"""A rig on a serial line, by the lines of docs/bench.md."""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from pma_gym.bench.line_format import LineBuffer, decoded, encoded, numbers
from pma_gym.bench.rig import RigError, Sample
from pma_gym.bench.rig_file import RigFile
from pma_gym.plant.model import load_model

_RESET_S = 3.0
"""How long a board may take to answer at first: opening a port resets some (assumption)."""


class SerialRig:
    """A rig whose firmware keeps the rules of docs/bench.md.

    Args:
        rig: content of the rig's file.
        port: open serial port: `write`, `read`, `in_waiting`, `timeout`.

    Attributes:
        bad_lines: number of lines that broke a rule and were passed over.
    """

    def __init__(self, rig: RigFile, port: Any) -> None:  # noqa: ANN401 - serial.Serial, or alike
        """Ask the firmware what it has.

        Raises:
            RigError: no answer, or other columns than those of the rig's file.
        """
        self.bad_lines = 0
        self._file, self._port, self._buffer = rig, port, LineBuffer()
        self._lines: list[bytes] = []
        self._number, self._last_bad = 0, ""
        ours = ["pma-rig", "1", ",".join(rig.commands), ",".join(rig.measurements)]
        theirs = self._ask("I", lambda words: words[0] == "I", _RESET_S)[1:]
        if theirs != ours:
            raise RigError(
                f"{rig.port}: the firmware must have what the rig's file has, {' '.join(ours)!r}, "
                f"got {' '.join(theirs)!r}; correct the columns and their order"
            )

    def arm(self) -> None:
        """Send watchdog, safe state and rest; see `Rig`."""
        words = "A", self._file.watchdog_ms, self._file.safe.ramp_ms, *self._file.rest
        self._ask(words, lambda words: words == ["A", "ok"], _RESET_S)

    def read(self) -> Sample:
        """Measure now; see `Rig`."""
        self._number += 1
        key = ["M", str(self._number)]
        words = self._ask(("R", self._number), lambda words: words[:2] == key)
        width = len(self._file.commands)
        values = numbers(words[2:], 3 + width + len(self._file.measurements))
        if values[1]:
            raise RigError(
                f"{self._file.port}: the rig is in its safe state: no command arrived for "
                f"{self._file.watchdog_ms} ms; lower rate_hz, or take a faster controller"
            )
        commands, measured = values[3 : 3 + width], values[3 + width :]
        return Sample(values[0] * 1e-6, commands, measured, values[2] * 1e-6)

    def write(self, command: Sequence[float]) -> None:
        """Send commands; see `Rig`."""
        self._send("C", *map(float, command))

    def safe(self) -> None:
        """Ask for the safe state; see `Rig`."""
        with suppress(RigError):
            self._ask("S", lambda words: words == ["S", "ok"])

    def _send(self, *words: object) -> None:
        try:
            self._port.write(encoded(*words))
        except OSError as error:
            raise RigError(f"{self._file.port}: the line is lost: {error}") from None

    def _ask(
        self,
        request: str | Sequence[object],
        fits: Callable[[list[str]], bool],
        seconds: float = 0.0,
    ) -> list[str]:
        """Send a request and return the words of the answer that fits."""
        limit = seconds or self._file.watchdog_ms * 1e-3
        again = limit if not seconds else 0.3
        end, due = time.monotonic() + limit, 0.0
        while (now := time.monotonic()) < end:
            if now >= due:
                # A board that is being reset has not received the first request.
                self._send(*request)
                due = now + again
            for words in self._received(min(end, due) - now):
                if fits(words):
                    return words
                if words[0] == "E":
                    raise RigError(
                        f"{self._file.port}: the rig refuses {request[0]}: {' '.join(words[1:])}"
                    )
        missing = f"no answer to {request[0]} within {1e3 * limit:g} ms{self._last_bad}"
        raise RigError(f"{self._file.port}: {missing}")

    def _received(self, seconds: float) -> Iterator[list[str]]:
        """Words of the lines that arrive, at the latest after some time."""
        if not self._lines:
            try:
                self._port.timeout = max(seconds, 1e-3)
                received = self._port.read(1)
                received += self._port.read(self._port.in_waiting)
            except OSError as error:
                raise RigError(f"{self._file.port}: the line is lost: {error}") from None
            self._lines = self._buffer.lines(received)
        first = self._buffer.count - len(self._lines)
        while self._lines:
            line = self._lines.pop(0)
            first += 1
            try:
                yield decoded(line)
            except RigError as error:
                self.bad_lines += 1
                self._last_bad = f"; line {first} from the rig: {error}"


@contextmanager
def open_rig(rig: RigFile) -> Iterator[SerialRig]:
    """Open the port of a rig's file, or start its emulator.

    Raises:
        RigError: no port, no answer, or another rig.
        ImportError: pyserial is missing.
    """
    try:
        import serial
    except ImportError:
        raise ImportError("a rig needs pyserial: pip install 'pma-gym[rig]'") from None
    with _port_name(rig) as name:
        try:
            port = serial.Serial(
                name, rig.baud, exclusive=True, write_timeout=rig.watchdog_ms * 1e-3
            )
        except OSError as error:
            raise RigError(f"port {name} cannot be opened: {error}; check its name") from None
        with port:
            yield SerialRig(rig, port)


@contextmanager
def _port_name(rig: RigFile) -> Iterator[str]:
    if rig.port != "emulator":
        yield rig.port
        return
    model = rig.emulated_model or rig.model
    # Its errors are said here, not by the other process.
    load_model(model)
    command = [sys.executable, "-m", "pma_gym.bench.emulator", model, str(rig.seed)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    # A session of its own: Ctrl-C in the terminal is for the host alone.
    with subprocess.Popen(command, start_new_session=True, **pipes) as process:
        assert process.stdin and process.stdout
        name = process.stdout.readline().removeprefix("port ").strip()
        if not name:
            raise RigError("the emulator did not start; see its message above")
        try:
            yield name
        finally:
            process.stdin.close()
            process.wait()
