"""Trains shortly with other people's libraries: `make test-integrations`, or with NAMES='skrl'.

Each has a virtual environment of its own in .integrations/, with the newest versions that pip finds
beside this project, and without constraints.txt but for PyTorch. A library that cannot be installed
is shown with pip's reason.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HOMES = ROOT / ".integrations"
FAILED, INTERRUPTED = 1, 130


@dataclass(frozen=True)
class Library:
    """A library and what it needs.

    Attributes:
        title: as it is printed.
        script: file beside this one, which prints one line when all is well.
        package: the distribution whose version is printed.
        needs: what pip installs.
    """

    title: str
    script: str
    package: str
    needs: tuple[str, ...]


LIBRARIES = {
    "torchrl": Library("TorchRL", "torchrl_ppo.py", "torchrl", ("torchrl",)),
    "rllib": Library("RLlib", "rllib_ppo.py", "ray", ("ray[rllib]",)),
    # The zoo imports requests without asking for it; Tianshou imports what its extra `eval` has.
    "zoo": Library("RL Baselines3 Zoo", "zoo.py", "rl_zoo3", ("rl_zoo3", "requests")),
    "cleanrl": Library("CleanRL", "cleanrl_ppo.py", "cleanrl", ("cleanrl",)),
    "skrl": Library("skrl", "skrl_ppo.py", "skrl", ("skrl[torch]",)),
    "tianshou": Library("Tianshou", "tianshou_ppo.py", "tianshou", ("tianshou[eval]",)),
}


class InstallError(RuntimeError):
    """An installation that failed; the message is pip's reason."""


def torch_pin() -> str:
    """The version of PyTorch in constraints.txt, which this machine has most likely got already."""
    text = (ROOT / "constraints.txt").read_text(encoding="utf-8")
    (pin,) = re.findall(r"^torch==\S+", text, re.MULTILINE)
    return pin


def install(name: str) -> Path:
    """Make a library's environment, if what it needs has changed; its Python.

    Raises:
        InstallError: pip, or the making of the environment, failed.
    """
    home = HOMES / name
    python = home / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    needs = [torch_pin(), *LIBRARIES[name].needs]
    wanted = "\n".join([*needs, (ROOT / "pyproject.toml").read_text(encoding="utf-8")])
    stamp = home / "installed.txt"
    if stamp.is_file() and stamp.read_text(encoding="utf-8") == wanted:
        return python
    print(f"{LIBRARIES[name].title}: installing (a minute or more)", file=sys.stderr, flush=True)
    shutil.rmtree(home, ignore_errors=True)
    run_or_quote([sys.executable, "-m", "venv", str(home)])
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    run_or_quote([*pip, "-e", str(ROOT), *needs])
    stamp.write_text(wanted, encoding="utf-8")
    return python


def run_or_quote(command: list[str]) -> None:
    """Run a command.

    Raises:
        InstallError: with the last error that it printed.
    """
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        lines = [line.strip() for line in (done.stderr + done.stdout).splitlines() if line.strip()]
        errors = [line for line in lines if "conflict" in line.lower() or "ERROR" in line]
        raise InstallError("; ".join(errors or lines[-1:]))


def train(name: str, python: Path) -> tuple[bool, str]:
    """Run a library's script; whether it succeeded, and its last line."""
    with tempfile.TemporaryDirectory() as folder:
        # Ray and others leave folders at home and where they were started.
        env = os.environ | {"HOME": folder, "OMP_NUM_THREADS": "1", "RAY_AUTH_MODE": "disabled"}
        script = Path(__file__).parent / LIBRARIES[name].script
        done = subprocess.run(
            [str(python), str(script)], cwd=folder, env=env, capture_output=True, text=True
        )
    good = done.returncode == 0
    printed = [line for line in (done.stdout if good else done.stderr).splitlines() if line.strip()]
    if not good:
        print(done.stdout + done.stderr, file=sys.stderr, flush=True)
    return good, (printed or ["it printed nothing"])[-1]


def version(python: Path, package: str) -> str:
    """The installed version of a distribution."""
    code = f"from importlib.metadata import version; print(version({package!r}))"
    done = subprocess.run([str(python), "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def row(name: str) -> bool:
    """Print a library's row of the table; whether nothing failed."""
    library, good, result = LIBRARIES[name], True, ""
    number = "-"
    try:
        python = install(name)
        number = version(python, library.package)
        good, result = train(name, python)
    except InstallError as error:
        result = f"not installed: {error}"
    verdict = "" if good else "FAILED: "
    print(f"| {library.title} | {number} | {verdict}{result} |", flush=True)
    return good


def main(names: list[str]) -> int:
    """Train with the libraries that are named, or with all; the exit status."""
    unknown = [name for name in names if name not in LIBRARIES]
    if unknown:
        known = ", ".join(LIBRARIES)
        print(f"error: unknown library {unknown[0]!r}; known: {known}", file=sys.stderr)
        return 2
    print("| Library | Version | Result |\n| :-- | :-- | :-- |", flush=True)
    try:
        results = [row(name) for name in names or LIBRARIES]
    except KeyboardInterrupt:
        print("interrupted; what is installed stays", file=sys.stderr)
        return INTERRUPTED
    return 0 if all(results) else FAILED


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
