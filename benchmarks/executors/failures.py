"""Results for pieces of work whose process died."""

import signal


class ProcessDied(RuntimeError):
    """The process that did a piece of work ended in the midst of it.

    Attributes:
        exit_code: of the process; less than 0 for a signal; None if it is not known.
    """

    def __init__(self, exit_code: int | None, again: bool = False) -> None:
        # Both arguments, so that it survives being sent to another process.
        super().__init__(exit_code, again)
        self.exit_code, self.again = exit_code, again

    def __str__(self) -> str:
        died = "its process died, and again when it ran alone" if self.again else "its process died"
        return f"{died}: {_how(self.exit_code)}"


class TookTooLong(RuntimeError):
    """A piece of work, or a call inside it, passed its time limit; its process was ended."""

    def __init__(self, what: str, limit_s: float) -> None:
        # Both arguments, so that it survives being sent to another process.
        super().__init__(what, limit_s)
        self.what, self.limit_s = what, limit_s

    def __str__(self) -> str:
        return (
            f"{self.what} took over {self.limit_s:g} s and was ended; look for an endless loop "
            "or for what waits there"
        )


def _how(exit_code: int | None) -> str:
    """How a process ended, and what to look for."""
    if exit_code is None:
        return "exit code unknown; look for what ends or hides a process in what it calls"
    if exit_code >= 0:
        return f"exit code {exit_code}; look for os._exit in what it calls"
    known = {signal.value: signal.name for signal in signal.Signals}
    name = known.get(-exit_code, "a signal without a name")
    fix = (
        "mostly for want of memory; look at how much it takes"
        if name == "SIGKILL"
        else "look for a crash in the compiled code that it calls"
    )
    return f"exit code {exit_code}, killed by {name}; {fix}"
