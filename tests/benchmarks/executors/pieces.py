"""Pieces of work for other processes; alone in a module that a new process imports at once."""

import os
import signal
import time


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


def loops():
    while True:
        pass


def sleeps(folder, index, seconds):
    """Leave this process's number, then sleep."""
    (folder / f"{index}.pid").write_text(str(os.getpid()))
    time.sleep(seconds)
    return index


def squared(number):
    return number * number
