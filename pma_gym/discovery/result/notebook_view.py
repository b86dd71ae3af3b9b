"""What a notebook shows of a diagnosis."""

from collections.abc import Mapping, Sequence

from pma_gym.discovery.result.estimates import Estimate, NamedEffect
from pma_gym.discovery.result.misfit import Gap
from pma_gym.pages.document import Block, Callout, TextTable
from pma_gym.pages.figures import notebook_html

_TONES = {"agrees": "good", "effect": "good", "parameters": "good", "unknown": "bad"}
_GAP_HEADER = ["Column", "Model as given", "Parameters refitted", "Model proposed", "Noise"]
_EFFECT_HEADER = ["Effect", "Parameter", "Estimate", "95 % interval", "Unit"]


def notebook_view(
    verdict: str, sentence: str, gap: Mapping[str, Gap], effects: Sequence[NamedEffect]
) -> str:
    """The HTML of a sentence, the gap by signal and the effects with their sizes.

    Args:
        verdict: sets the colour of the sentence.
        sentence: the verdict in words.
        gap: by column name.
        effects: those that are missing.
    """
    blocks: list[Block] = [Callout(sentence, tone=_TONES.get(verdict, "open"))]
    if gap:
        blocks.append(TextTable("Misfit (rms)", _GAP_HEADER, [*map(_gap_row, gap.items())]))
    rows = [
        [effect.name, name, f"{size.value:.3g}", _interval_text(size), size.unit]
        for effect in effects
        for name, size in effect.parameters.items()
    ]
    if rows:
        blocks.append(TextTable("Effects that are missing", _EFFECT_HEADER, rows, words=2))
    return notebook_html(blocks)


def _gap_row(gap: tuple[str, Gap]) -> list[str]:
    signal, sizes = gap
    values = (sizes.before, sizes.parameters, sizes.after, sizes.floor)
    return [signal, *(f"{value:.3g}" for value in values)]


def _interval_text(size: Estimate) -> str:
    if size.low is None or size.high is None:
        return ""
    return f"{size.low:.3g} to {size.high:.3g}"
