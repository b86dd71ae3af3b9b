"""Block `rigs`: data sets of joints, slides and imposed motions that other simulators made."""

from dataclasses import dataclass

from benchmarks.hidden_effects.generation.blocks import Block
from benchmarks.hidden_effects.generation.cases import Case


@dataclass(frozen=True)
class RigsBlock(Block):
    """Cases of other labs' rigs; of 600 cases 200 hide one effect, 100 two, 200 nothing."""

    def draw(self, seed: int, number: int) -> Case:
        """Case of a number, 1 and up; the same seed and number give the same bits."""
        # Here, for no other block needs its simulators.
        from benchmarks.hidden_effects.rigs.drawing import draw

        texts, truth = draw(seed, number)
        return Case([], [], [], [], {}, truth, texts)
