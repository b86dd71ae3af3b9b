"""Whom this package is compared with: their packages, and the environments that these live in.

What needs more than this package's core has an environment of its own, `.peers/NAME`, which
`make peers` makes from the pins in `requirements/NAME.txt`.
"""

import hashlib
import importlib.util
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / ".peers"
"""Where the environments are; ignored by git."""

_PINS = Path(__file__).resolve().parent / "requirements"
_STAMP = ".installed"


@dataclass(frozen=True)
class Peer:
    """One worker: what it compares with and what it needs.

    Attributes:
        name: its own name and its environment's folder; its worker is `workers/serve_NAME.py`.
        title: its name for readers.
        pinned: whether it has an environment of its own with the pins in `requirements`.
        project: extras of this project that its environment has, "" for the core alone; None if
            it has not this project. With extras, this very interpreter serves if it has them.
        modules: what this interpreter must have to serve.
    """

    name: str
    title: str
    pinned: bool = False
    project: str | None = None
    modules: tuple[str, ...] = ()

    @property
    def installed(self) -> bool:
        """Whether `make peers` installs it: it does not live in this project's environment."""
        return self.pinned or self.project is not None

    @property
    def pins(self) -> Path | None:
        """The file of its pins, if it has one."""
        return _PINS / f"{self.name}.txt" if self.pinned else None

    @property
    def home(self) -> Path:
        """Folder of its environment."""
        return FOLDER / self.name

    @property
    def stamp(self) -> Path:
        """A file that says what was installed, written last."""
        return self.home / _STAMP

    @property
    def wanted(self) -> str:
        """What the stamp says if the installation is that of these pins."""
        texts = [self.pins.read_text(encoding="utf-8")] if self.pins else []
        if self.project is not None:
            texts.append((ROOT / "constraints.txt").read_text(encoding="utf-8"))
            texts += _dependencies(self.project)
        return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:16]

    @property
    def is_here(self) -> bool:
        """Whether this interpreter has all packages of the worker."""
        if self.modules:
            return all(importlib.util.find_spec(name) for name in self.modules)
        return not self.installed

    @property
    def is_ready(self) -> bool:
        """Whether its environment is complete."""
        return self.stamp.is_file() and self.stamp.read_text(encoding="utf-8") == self.wanted

    @property
    def python(self) -> Path | None:
        """The interpreter that runs its worker; None if it is not installed."""
        if self.is_here:
            return Path(sys.executable)
        return executable(self.home) if self.is_ready else None

    @property
    def absence(self) -> str:
        """Why it has no interpreter."""
        if self.stamp.is_file():
            return "its pins have changed since it was installed; `make peers` installs it anew"
        return "not installed; `make peers` installs it"


def _dependencies(extra: str) -> list[str]:
    """What this project asks for, alone and with an extra."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return project["dependencies"] + project["optional-dependencies"].get(extra, [])


def executable(home: Path) -> Path:
    """The interpreter of a virtual environment."""
    if sys.platform == "win32":
        return home / "Scripts" / "python.exe"
    return home / "bin" / "python"


PEERS = {
    peer.name: peer
    for peer in (
        Peer("own", "pma-gym"),
        Peer("classic", "Gymnasium"),
        Peer("scipy", "scipy"),
        Peer("mujoco", "MuJoCo", pinned=True),
        Peer("dm_control", "dm_control", pinned=True),
        Peer("envpool", "EnvPool", pinned=True),
        Peer("gymnax", "gymnax", pinned=True),
        Peer("electric_motor", "gym-electric-motor", pinned=True),
        Peer("pcgym", "PC-gym", pinned=True),
        Peer("dompc", "do-mpc", pinned=True, project=""),
        Peer("sb3", "Stable-Baselines3", project="rl", modules=("torch", "stable_baselines3")),
    )
}
"""All workers by name."""
