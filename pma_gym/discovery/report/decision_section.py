"""How a diagnosis was decided: the part of its page for who wants to check it."""

from collections.abc import Mapping

from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.report.effect_text import effect_names, readable
from pma_gym.discovery.report.tables import (
    candidates_table,
    floors_table,
    moved_table,
    unknown_table,
)
from pma_gym.pages.document import Block, Heading, Paragraph, Steps, TextTable

_CANDIDATES = (
    "Every effect of the catalogue that this model does not have, each fitted together with the "
    "model's own parameters. The gain in log-likelihood counts residuals freed of their "
    "correlation in time. “By chance”: the share of data sets without any missing effect in which "
    "some effect of the catalogue would gain as much. “Change”: what it changes in the signals "
    "beyond what parameters could. “Would show from”: the smallest size that these trials reveal, "
    "as a share of the effect's usual size."
)


def decision_blocks(diagnosis: Diagnosis, origin: Mapping[str, str]) -> list[Block]:
    """Steps, candidates, noise, parameters, effects not detectable, origin."""
    blocks: list[Block] = [Heading("How it was decided")]
    if diagnosis.steps:
        blocks.append(Steps([readable(step, diagnosis) for step in diagnosis.steps]))
    if diagnosis.candidates:
        blocks += [Heading("Candidates", 3), Paragraph(_CANDIDATES)]
        blocks.append(candidates_table(diagnosis))
    blocks += _not_detectable_blocks(diagnosis)
    blocks += _parameter_blocks(diagnosis)
    if diagnosis.floors:
        blocks.append(floors_table(diagnosis.floors))
    return blocks + _origin_blocks(diagnosis, origin)


def _not_detectable_blocks(diagnosis: Diagnosis) -> list[Block]:
    if not diagnosis.not_detectable:
        return []
    return [
        Heading("Not detectable in these data", 3),
        Paragraph(
            "These data would not show the following effects even at their usual size, so the "
            f"diagnosis cannot exclude them: {effect_names(diagnosis.not_detectable)}."
        ),
    ]


def _parameter_blocks(diagnosis: Diagnosis) -> list[Block]:
    if not (diagnosis.parameters or diagnosis.not_identifiable or diagnosis.floors):
        return []
    blocks: list[Block] = [Heading("Parameters and noise", 3)]
    if diagnosis.parameters and diagnosis.verdict != "parameters":
        blocks.append(moved_table(diagnosis.parameters, "The model's own parameters that moved"))
    if diagnosis.not_identifiable:
        blocks.append(unknown_table(diagnosis))
    return blocks


def _origin_blocks(diagnosis: Diagnosis, origin: Mapping[str, str]) -> list[Block]:
    rows = [["Model as given", f"`{diagnosis.given.name}`: {diagnosis.given.title}"]]
    rows += [[name, text] for name, text in origin.items()]
    rows += [[f"Time: {step}", f"{seconds:.1f} s"] for step, seconds in diagnosis.seconds.items()]
    return [
        Heading("How it was made", 3),
        TextTable("", ["", ""], rows, words=2),
        Paragraph(
            "`diagnosis.json` beside this page holds every figure with all its digits, "
            "`model.toml` the model proposed."
        ),
    ]
