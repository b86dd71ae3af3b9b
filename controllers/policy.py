"""Controllers that a network computes: policies from a file, and those that are shipped."""

import math
from pathlib import Path

from controllers.design.designs import loop_name, task_kind, warn_of_other_plant
from controllers.policies.adapter import PolicyAdapter
from controllers.policies.document import PolicyError
from controllers.policies.network import Network
from controllers.policies.policy_file import PolicyFile, load_policy_file
from controllers.registry import Reference
from pma_gym.envs import Measurement, StationInfo

POLICIES = Path(__file__).parent / "policies" / "shipped"
"""Folder of the shipped policies, each called `{kind of task}-{loop}-{algorithm}`."""

SHOWN = 3
"""How many entries that differ a message names; the others it counts."""


class Policy:
    """A trained policy on the station that it was trained for.

    Args:
        path: its file, see `controllers.policies.policy_file`.
        anywhere: whether it may run at another control rate or delay than it was trained with, to
            see what becomes of it. What it sees must be the same all the same.

    Attributes:
        name: its name in the file.
        file: the PolicyFile.
    Raises:
        PolicyError: a file that cannot be used.
    """

    def __init__(self, path: Path | str, *, anywhere: bool = False) -> None:
        """Read and check the file."""
        self.file = load_policy_file(path)
        self.name, self.anywhere = self.file.name, anywhere
        self._network = Network(self.file.weights)
        self._adapter = PolicyAdapter(self.file.view, self.file.form)

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Prepare for a trial.

        Raises:
            PolicyError: a station that it was not trained for; names every difference.
        """
        refused = differences(self.file, station, self.anywhere)
        if refused:
            raise PolicyError(
                f"policy {self.name} was not trained for this station: {'; '.join(refused)}. Give "
                "the environment what it was trained for, or take a policy of this task and loop; "
                "at another rate or delay it runs as Policy(path, anywhere=True)"
            )
        made_for = str(self.file.environment["kwargs"].get("model", "station"))
        warn_of_other_plant(
            station,
            f"the weights of policy {self.name}",
            made_for,
            "train one on it: python -m benchmarks train",
        )
        self._adapter.reset(reference, station)

    def act(self, measurement: Measurement, time: float) -> float:
        """Voltage (V, 0-10) to hold for the next control period."""
        return self._adapter.volts(float(self._network(self._adapter.update(measurement, time))[0]))


class ShippedPolicy:
    """The policy that an algorithm trained for the station's task and loop, from the package.

    Args:
        algorithm: `ppo`, `sac`, `td3`, `tqc`: how the file's name ends.
        folder: where the files are.

    Attributes:
        name: the algorithm's name.
    """

    def __init__(self, algorithm: str, folder: Path = POLICIES) -> None:
        """Note where to look; files are read when a station asks for them."""
        self.name, self._folder = algorithm, folder
        self._policies: dict[str, Policy] = {}
        self._policy: Policy | None = None

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Take the policy for the station, and prepare it for a trial.

        Raises:
            PolicyError: none is shipped for this kind of task and loop; names those that are.
        """
        self._policy = None
        policy = self._chosen(station)
        policy.reset(reference, station)
        self._policy = policy

    def act(self, measurement: Measurement, time: float) -> float:
        """Voltage (V, 0-10) to hold for the next control period.

        Raises:
            RuntimeError: it was not reset.
        """
        if self._policy is None:
            raise RuntimeError(f"policy {self.name} has no trial: call reset() before act()")
        return self._policy.act(measurement, time)

    def _chosen(self, station: StationInfo) -> Policy:
        # Gains of the nearest loop serve; a network's weights hold for the loop that made them.
        name = f"{task_kind(station)}-{loop_name(station)}-{self.name}"
        if name not in self._policies:
            stems = [path.stem for path in shipped_policies(self._folder)]
            shipped = [stem for stem in stems if stem.endswith(f"-{self.name}")]
            if name not in shipped:
                raise PolicyError(
                    f"no policy {name} is shipped (kind of task, loop, algorithm), of {self.name} "
                    f"only {', '.join(shipped) or 'none at all'}; take a task, control rate and "
                    "delay of these"
                )
            self._policies[name] = Policy(self._folder / f"{name}.json")
        return self._policies[name]


class PPOPolicy(ShippedPolicy):
    """The shipped policies that proximal policy optimisation trained.

    Source:
        J. Schulman, F. Wolski, P. Dhariwal, A. Radford and O. Klimov 2017, "Proximal Policy
        Optimization Algorithms", arXiv:1707.06347.
    """

    algorithm = "ppo"

    def __init__(self) -> None:
        super().__init__(self.algorithm)


def shipped_policies(folder: Path = POLICIES) -> list[Path]:
    """The shipped policies' .json files by name; none where there is no such folder."""
    return sorted(folder.glob("*.json"))


def differences(file: PolicyFile, station: StationInfo, anywhere: bool = False) -> list[str]:
    """What makes a station another one than a policy was trained for, in words.

    Args:
        file: the policy.
        station: the station.
        anywhere: whether control rate and delays may differ.
    """
    differing = []
    kind = task_kind(station)
    if kind != file.task:
        differing.append(f"the task's kind is {kind}, trained for {file.task}")
    trained = file.environment["kwargs"]
    if not anywhere:
        for what, actual, expected, unit in (
            ("control rate", 1.0 / station.period, trained["control_rate_hz"], "Hz"),
            ("action delay", station.action_delay, trained["action_delay_s"], "s"),
            ("observation delay", station.observation_delay, trained["observation_delay_s"], "s"),
        ):
            if not math.isclose(actual, expected, rel_tol=1e-6, abs_tol=1e-6):
                differing.append(
                    f"the {what} is {actual:g} {unit}, trained for {expected:g} {unit}"
                )
    return differing + _other_rows(file, station)


def _other_rows(file: PolicyFile, station: StationInfo) -> list[str]:
    """Entries of the observation that are others, and their count if it is another."""
    rows, known = file.view.rows(station, file.form.base), file.observation
    differing = []
    if len(rows) != len(known):
        differing.append(f"the observation has {len(rows)} entries, trained for {len(known)}")
    others = [
        f"entry {i} of the observation is {actual[0]} (1.0 = {actual[1]}), trained for "
        f"{trained[0]} (1.0 = {trained[1]})"
        for i, (actual, trained) in enumerate(zip(rows, known, strict=False))
        if actual != trained
    ]
    differing += others[:SHOWN]
    if len(others) > SHOWN:
        differing.append(f"and {len(others) - SHOWN} more entries differ")
    return differing
