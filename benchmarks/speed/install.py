"""Installs the peers: `make peers`, or `python -m benchmarks.speed.install [NAME...]`.

Each in a virtual environment of its own, with every version pinned. One that cannot be installed
here is named with pip's reason and left out; the others go on.
"""

import shutil
import subprocess
import sys
from typing import Annotated

import typer

from benchmarks.speed.peers import PEERS, ROOT, Peer

_PIP = ("-m", "pip", "install", "--disable-pip-version-check", "--no-input", "--quiet")


class InstallError(RuntimeError):
    """An installation that failed; the message is pip's reason."""


def install(peer: Peer) -> None:
    """Make a peer's environment anew.

    Raises:
        InstallError: pip, or the making of the environment, failed.
    """
    shutil.rmtree(peer.home, ignore_errors=True)
    peer.home.parent.mkdir(exist_ok=True)
    _run(sys.executable, "-m", "venv", str(peer.home))
    # The pins are complete; what a package asks for beyond them, the worker does not use.
    _run(str(peer.interpreter), *_PIP, "--no-deps", "-r", str(peer.pins))
    shutil.copy(peer.pins, peer.stamp)


def _run(*command: str) -> None:
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        raise InstallError(reason(done.stderr or done.stdout))


def reason(printed: str) -> str:
    """The last error that pip printed; the last line, if it named none."""
    lines = [line.strip() for line in printed.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("ERROR")]
    return (errors or lines or ["no reason given"])[-1]


def main(
    names: Annotated[
        list[str] | None, typer.Argument(help="Peers to install; all if none is named.")
    ] = None,
) -> None:
    """Install what the speed of this package is compared with, into .peers/."""
    known = {peer.name: peer for peer in PEERS}
    for name in names or ():
        if name not in known:
            print(f"error: unknown peer {name!r}; known: {', '.join(known)}", file=sys.stderr)
            raise typer.Exit(2)
    chosen, failed = [known[name] for name in names or known], []
    for peer in chosen:
        try:
            if peer.python is None:
                print(f"{peer.title}: installing (some minutes)", flush=True)
                install(peer)
            print(f"{peer.title}: installed", flush=True)
        except InstallError as error:
            failed.append(peer.title)
            print(f"{peer.title}: left out, it could not be installed: {error}", flush=True)
    if failed:
        print(f"Left out: {', '.join(failed)}. The benchmark runs without them.")
    raise typer.Exit(1 if len(failed) == len(chosen) else 0)


if __name__ == "__main__":
    typer.run(main)
