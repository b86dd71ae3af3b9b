"""The blocks of the target table: what their cases hide, and how large."""

from dataclasses import dataclass

from benchmarks.hidden_effects.generation.cases import Case, draw_case
from benchmarks.hidden_effects.generation.effects import KINDS, OUTSIDE
from benchmarks.hidden_effects.generation.readout_noise import UGLY


@dataclass(frozen=True)
class Block:
    """Cases of one kind.

    Attributes:
        name: of the block.
        turns: effects that cases take turns in, so that each is hidden equally often; where empty,
            `draw_case` decides what is hidden.
        ratio: range of r, what an effect changes beyond a refit over the noise.
        trials: of a case.
        seconds: of a trial (s).
        rounds: experiments that follow on the same rig, where the diagnosis asks for one.
        ugly: what stands in the readings beside noise (`readout_noise`); empty: nothing.
    """

    name: str
    turns: tuple[str, ...] = ()
    ratio: tuple[float, float] = (0.5, 2.0)
    trials: int = 6
    seconds: float = 8.0
    rounds: int = 0
    ugly: str = ""

    def draw(self, seed: int, number: int) -> Case:
        """Case of a number, 1 and up; the same seed and number give the same bits."""
        hidden = (self.turns[(number - 1) % len(self.turns)],) if self.turns else None
        drawn = (self.trials, self.seconds, self.ratio, self.ugly)
        return draw_case(seed, number, self.name, hidden, *drawn)


BLOCKS: dict[str, Block] = {
    block.name: block
    for block in (
        Block("single", tuple(KINDS)),
        Block("faint", tuple(KINDS), (0.3, 0.3)),
        Block("nothing"),
        Block("parameters"),
        Block("pair"),
        Block("unknown", tuple(OUTSIDE)),
        *(Block(f"single_{ugly}", tuple(KINDS), ugly=ugly) for ugly in UGLY),
        *(Block(f"nothing_{ugly}", ugly=ugly) for ugly in UGLY),
        Block("slow_drift", ("creep", "leakage", "warm_up"), ugly="drift"),
    )
}
"""By name, in the order of the table."""
