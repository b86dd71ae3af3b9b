"""Pieces of work for other processes; alone in a module that a new process imports at once."""

import os
import signal

from benchmarks.runner.worker import begin_limited, end_limited


class Awkward(Exception):
    """An exception that no other process can make again."""

    def __init__(self, one, two):
        super().__init__(f"{one} {two}")


def exits(code):
    os._exit(code)


def kills_itself():
    os.kill(os.getpid(), signal.SIGKILL)


def dies_once(marker):
    if not marker.exists():
        marker.touch()
        os._exit(1)
    return "alive"


def raises(error):
    raise error


def awkward():
    raise Awkward("one", "two")


def loops(limit_s):
    begin_limited("thinking", limit_s)
    while True:
        pass


def is_quick():
    begin_limited("thinking", 30.0)
    end_limited()
    return "quick"
