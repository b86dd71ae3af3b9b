"""Controllers to score: of the registry, a class in a user's file, or a policy."""

import difflib
import inspect
import traceback
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import controllers.registry
from controllers import CONTROLLERS
from controllers.policies.policy_file import PolicyError, policy_pair
from controllers.policy import POLICIES, Policy, ShippedPolicy, shipped_policies
from controllers.registry import Controller
from pma_gym.cli.controller_source import ControllerSourceError, class_in_file

CONTROLLER_INTERFACE = Path(controllers.registry.__file__)
"""File that says what a controller is."""

POLICY_FILES = (".json", ".safetensors")
"""Endings of a policy's two files."""


class ControllerError(ValueError):
    """A controller that cannot be scored; the message says why and how to fix it."""


@dataclass(frozen=True)
class ControllerSpec:
    """A controller by its name; made anew for every case, in the process that runs the case.

    Attributes:
        name: what the results call it; the class for one of one's own.
        title: what the report calls it; for a class of one's own, its attribute `name`.
        path: file of its class or of its policy, or folder of policies; empty for one of
            `controllers.CONTROLLERS`.
        algorithm: of the policies in a folder; else empty.
    """

    name: str
    title: str = ""
    path: str = ""
    algorithm: str = ""

    @property
    def source(self) -> str:
        """Name on the command line."""
        if self.is_policy:
            return f"{self.path}:{self.algorithm}" if self.algorithm else self.path
        return f"{self.path}:{self.name}" if self.path else self.name

    @property
    def is_policy(self) -> bool:
        """Whether it is a policy from a file or a folder of policies."""
        return bool(self.algorithm) or self.path.endswith(POLICY_FILES)

    @property
    def is_bound(self) -> bool:
        """Whether it is the project's bound, the only controller that receives the environment."""
        return not self.path and hasattr(CONTROLLERS.get(self.name), "receive")

    @property
    def kinds(self) -> frozenset[str]:
        """Kinds of task that it can do; all if empty."""
        if self.algorithm:
            files = shipped_policies(Path(self.path))
            return frozenset(
                path.stem.partition("-")[0]
                for path in files
                if path.stem.endswith(f"-{self.algorithm}")
            )
        if self.is_policy:
            return frozenset((_loaded(self.path).file.task,))
        return frozenset(getattr(CONTROLLERS.get(self.name), "kinds", ()) if not self.path else ())

    @property
    def label(self) -> str:
        """Its title, or its name if it has none."""
        return self.title or self.name

    @property
    def files(self) -> list[Path]:
        """Files that its figures depend on, besides the project's code: its own, or a policy's."""
        algorithm = self.algorithm or ("" if self.path else shipped_algorithm(self.name))
        if algorithm:
            folder = Path(self.path) if self.algorithm else POLICIES
            names = [p for p in shipped_policies(folder) if p.stem.endswith(f"-{algorithm}")]
            return [file for path in names for file in policy_pair(path)]
        if not self.path:
            return []
        return list(policy_pair(self.path)) if self.is_policy else [Path(self.path)]

    def make(self) -> Controller:
        """A new controller.

        Raises:
            ControllerError: its file, class or methods are missing or do not work.
        """
        if not self.path and self.name not in CONTROLLERS:
            near = difflib.get_close_matches(self.name, CONTROLLERS, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise ControllerError(
                f"no controller {self.name!r}; there are {', '.join(CONTROLLERS)}, or give "
                f"path/to/file.py:ClassName{hint}"
            )
        if self.algorithm:
            return ShippedPolicy(self.algorithm, Path(self.path))
        if self.is_policy:
            return _loaded(self.path)
        factory = _class_of(self) if self.path else CONTROLLERS[self.name]
        try:
            controller = factory()
        except Exception as error:
            where = raised_at(error, Path(self.path)) or "a controller must need no arguments"
            raise ControllerError(
                f"cannot make {self.source}: {factory.__name__}() raised "
                f"{type(error).__name__}: {error}; {where}"
            ) from error
        _check_interface(self, controller)
        return controller


def parse_controllers(text: str, known: Sequence[ControllerSpec] = ()) -> list[ControllerSpec]:
    """Controllers from a list as the command line has it: `pid,path/to/mine.py:MyController`.

    Args:
        text: names, files with a class, policies, separated by commas.
        known: controllers whose titles are kept.
    Raises:
        ControllerError: one that cannot be made; each is tried.
    """
    titled = {spec.name: spec for spec in known}
    specs = []
    for item in (part.strip() for part in text.split(",")):
        if not item:
            raise ControllerError(f"an empty name in {text!r}; separate controllers by one comma")
        path, colon, name = item.rpartition(":")
        if item.endswith(".py") or (colon and not name):
            raise ControllerError(f"{item} names no class; write {item.rstrip(':')}:ClassName")
        spec = _policy(item) or (
            ControllerSpec(name, path=path) if colon else titled.get(item, ControllerSpec(item))
        )
        made = spec.make()
        if spec.path and not spec.title:
            spec = replace(spec, title=_own_name(made))
        specs.append(spec)
    return specs


def _loaded(path: str) -> Policy:
    """A policy from its file.

    Raises:
        ControllerError: a file that cannot be used.
    """
    try:
        return Policy(path)
    except PolicyError as error:
        raise ControllerError(str(error)) from error


def shipped_algorithm(name: str) -> str:
    """Algorithm of the shipped policies that a controller of the registry runs; else empty."""
    return getattr(CONTROLLERS.get(name), "algorithm", "")


def _policy(item: str) -> ControllerSpec | None:
    """A policy's file, or a folder of policies with their algorithm (`folder:ppo`); else None.

    Raises:
        ControllerError: the folder has no policy of that algorithm.
    """
    if item.endswith(POLICY_FILES):
        document, _ = policy_pair(item)
        return ControllerSpec(document.stem, path=str(document))
    path, colon, algorithm = item.rpartition(":")
    if not colon or not Path(path).is_dir():
        return None
    folder = Path(path)
    spec = ControllerSpec(f"{folder.name}-{algorithm}", path=path, algorithm=algorithm)
    if not spec.kinds:
        has = ", ".join(file.stem for file in shipped_policies(folder)) or "no policy at all"
        raise ControllerError(f"{folder} has no policy of {algorithm!r}; it has {has}")
    return replace(spec, title=f"{algorithm}, {folder.name}")


def _own_name(controller: Controller) -> str:
    """What a controller calls itself; nothing if it does not."""
    name = getattr(controller, "name", "")
    return name.strip() if isinstance(name, str) else ""


def _class_of(spec: ControllerSpec) -> type:
    """The controller's class, from its file."""
    path = Path(spec.path)
    try:
        return class_in_file(path, spec.name)
    except ControllerSourceError as error:
        where = raised_at(error.__cause__, path) if error.__cause__ else ""
        raise ControllerError(f"{error} ({where})" if where else str(error)) from error


def raised_at(error: BaseException, path: Path) -> str:
    """Return where in a user's file an exception came from: its last frame, in words.

    Args:
        error: as it was caught.
        path: the file.
    Returns:
        `line 9 of mine.py`, and where that line's own calls raised it; empty if no frame is of it.
    """
    if not path.name:
        return ""
    frames = traceback.extract_tb(error.__traceback__)
    # Whatever links lead to the file.
    paths = [Path(frame.filename).resolve() for frame in frames]
    own = [at for at, each in enumerate(paths) if each == path.resolve()]
    if not own:
        return ""
    where, last = f"line {frames[own[-1]].lineno} of {path.name}", frames[-1]
    # A helper beside the file is the author's too; a library's inside is not.
    beside = Path(last.filename).resolve().parent == path.resolve().parent
    if own[-1] < len(frames) - 1 and beside:
        where += f", which calls line {last.lineno} of {Path(last.filename).name}"
    return where


def _check_interface(spec: ControllerSpec, controller: object) -> None:
    """Refuse an object that is no `controllers.registry.Controller`."""
    for method, arguments in (("reset", "(reference, station)"), ("act", "(observation, time)")):
        function = getattr(controller, method, None)
        if not callable(function):
            raise ControllerError(
                f"{spec.source} has no method {method}{arguments}; a controller needs reset "
                f"and act, see {CONTROLLER_INTERFACE}"
            )
        try:
            inspect.signature(function).bind(None, None)
        except (TypeError, ValueError):
            raise ControllerError(
                f"{spec.source}: {method} must take {arguments}, see {CONTROLLER_INTERFACE}"
            ) from None
