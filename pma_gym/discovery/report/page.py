"""The page of a diagnosis: the answer first, then where it comes from."""

from collections.abc import Mapping

from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.report.adequacy_text import floors_left
from pma_gym.discovery.report.curves import curves_figure, curves_picture, worst_trial
from pma_gym.discovery.report.decision_section import decision_blocks
from pma_gym.discovery.report.effect_text import (
    effect_equation,
    effect_name,
    effect_names,
    effect_summary,
    effect_symbols,
    readable,
)
from pma_gym.discovery.report.figure_text import capitalised, chance, duration, odds
from pma_gym.discovery.report.latent_picture import drawn_in, latent_picture
from pma_gym.discovery.report.next_steps import what_to_do
from pma_gym.discovery.report.pictures import (
    after_name,
    commands_picture,
    gap_picture,
    law_picture,
    map_picture,
    trials_picture,
)
from pma_gym.discovery.report.tables import (
    adequacy_table,
    confusion_table,
    effect_table,
    gap_table,
    moved_table,
    places_table,
)
from pma_gym.discovery.report.verdict_text import VERDICTS
from pma_gym.discovery.result.estimates import NamedEffect
from pma_gym.effects import CATALOGUE
from pma_gym.pages.document import (
    Block,
    Callout,
    Formula,
    Heading,
    Paragraph,
    Picture,
    Steps,
    to_html,
)

_TONES = {"effect": "good", "parameters": "good", "agrees": "good", "unknown": "bad"}
_MOST_MAPS = 4


def report_page(
    diagnosis: Diagnosis, title: str = "", origin: Mapping[str, str] | None = None
) -> str:
    """A diagnosis as one page of HTML that needs nothing else.

    Args:
        diagnosis: what was found.
        title: of the data set.
        origin: what the page must say to be made again: data set, seed, versions.
    """
    return to_html(report_blocks(diagnosis, title, origin or {}), report_pictures(diagnosis))


def report_blocks(diagnosis: Diagnosis, title: str, origin: Mapping[str, str]) -> list[Block]:
    """The whole page."""
    heading = f"{VERDICTS[diagnosis.verdict]}{': ' if title else ''}{title}"
    tone = _TONES.get(diagnosis.verdict, "open")
    blocks: list[Block] = [
        Heading(heading, 1),
        Callout(readable(diagnosis.sentence, diagnosis), tone=tone),
    ]
    left = floors_left(diagnosis)
    blocks += [Paragraph(left)] if left else []
    blocks += [Paragraph(f"**Note:** {warning}") for warning in diagnosis.warnings]
    blocks += [Heading("What to do now"), Steps(what_to_do(diagnosis))]
    blocks += _where_blocks(diagnosis)
    blocks += _gap_blocks(diagnosis)
    blocks += _law_blocks(diagnosis)
    for effect in diagnosis.effects:
        blocks += _effect_blocks(effect)
    blocks += _parameter_blocks(diagnosis)
    blocks += _confusion_blocks(diagnosis)
    blocks += _next_blocks(diagnosis)
    return blocks + decision_blocks(diagnosis, origin)


def report_pictures(diagnosis: Diagnosis) -> dict[str, bytes]:
    """Every plot that there are figures for, as PNG by name."""
    pictures: dict[str, bytes] = {}
    if diagnosis.gap:
        names = ("as given", "refitted", after_name(diagnosis).replace(" ", "\n"))
        pictures["gap"] = gap_picture(dict(diagnosis.gap), names)
    if len([each for each in diagnosis.trials if each.gaps]) > 1:
        pictures["trials"] = trials_picture(diagnosis)
    worst = worst_trial(diagnosis)
    if worst:
        pictures["worst"] = curves_picture(worst, diagnosis)
    if diagnosis.maps:
        pictures["maps"] = map_picture(diagnosis.maps[:_MOST_MAPS])
    if any(each.latent for each in diagnosis.trials):
        pictures["latent"] = latent_picture(diagnosis)
    if diagnosis.law and not drawn_in(diagnosis):
        pictures["law"] = law_picture(diagnosis.law)
    if diagnosis.next_experiment:
        pictures["next"] = commands_picture(diagnosis.next_experiment.trial)
    return pictures


def _where_blocks(diagnosis: Diagnosis) -> list[Block]:
    if not diagnosis.where and not diagnosis.maps:
        return []
    text = (
        "What is left between measurement and simulation once the model's own parameters are "
        "refitted, sorted by the conditions that it arose in. A share far above what the place "
        "takes up of the trials tells which physics to look at."
    )
    blocks: list[Block] = [Heading("Where they disagree"), Paragraph(text)]
    if diagnosis.where:
        blocks.append(places_table(diagnosis.where))
    caption = (
        "Mean residual in units of the noise, parameters refitted. Orange: measured below "
        "simulated; purple: above; grey: no readings. Noise alone stays near 0."
    )
    return [*blocks, Picture("maps", caption)]


def _gap_blocks(diagnosis: Diagnosis) -> list[Block]:
    if not diagnosis.gap:
        return []
    held = any(gap.held_out for gap in diagnosis.gap.values())
    seen = (
        "“Held out”: each trial, or stretch of a single one, is predicted by a fit without it."
        if held
        else "No trial was held out: the figures are those of the fit itself."
    )
    caption = (
        "Misfit over all trials, on a logarithmic scale where it fell far. Dashed: the noise, "
        f"below which no model gets. {seen}"
    )
    worst = worst_trial(diagnosis)
    return [
        Heading("Before and after"),
        Picture("gap", caption),
        gap_table(diagnosis.gap),
        *([adequacy_table(diagnosis.adequacy)] if diagnosis.adequacy else []),
        Picture("trials", "Misfit of every trial in units of the noise, the worst on top."),
        Heading("The worst trial", 3),
        Picture(
            "worst",
            f"{worst.name if worst else ''}, the trial that the model as given misses most. Grey "
            "band: twice the noise to either side.",
        ),
        *([curves_figure(worst, diagnosis)] if worst else []),
    ]


def _effect_blocks(effect: NamedEffect) -> list[Block]:
    name = effect_name(effect.name)
    known = CATALOGUE.get(effect.name)
    words = [effect_summary(effect.name)]
    if known and known.signature:
        words.append(f"In data it shows as: {known.signature}.")
    words.append(f"So large a gain by chance, anywhere in the catalogue: {chance(effect.p_value)}.")
    blocks: list[Block] = [Heading(f"The effect: {name}"), Paragraph(" ".join(filter(None, words)))]
    equation = effect_equation(effect.name)
    if equation:
        symbols = effect_symbols(effect.name)
        blocks.append(Formula(f"{equation}\n\n{symbols}".strip()))
    if effect.parameters:
        blocks.append(effect_table(effect))
    return blocks


def _parameter_blocks(diagnosis: Diagnosis) -> list[Block]:
    """The moved parameters, up here only where they are the answer."""
    if diagnosis.verdict != "parameters" or not diagnosis.parameters:
        return []
    return [Heading("Which parameters were off"), moved_table(diagnosis.parameters)]


def _law_blocks(diagnosis: Diagnosis) -> list[Block]:
    law = diagnosis.law
    forces = [each.latent for each in diagnosis.trials if each.latent]
    blocks = list[Block]()
    if forces:
        inside = drawn_in(diagnosis)
        said = f" Blue, with its 95 % band, its law: it {law.words}." if law and inside else ""
        proposed = f"; green: {after_name(diagnosis)}" if forces[0].after is not None else ""
        caption = (
            "Smoothed latent force, which stands for all that the model lacks. Grey: parameters "
            f"refitted, nothing added{proposed}. On top, the trials with most of it.{said}"
        )
        heading = Heading(f"The latent force{' before and after' if proposed else ''}")
        blocks = [heading, Picture("latent", caption)]
    if law is None or drawn_in(diagnosis):
        return blocks
    caption = f"What the model lacks, found by a flexible law: {law.quantity}. Band: 95 %."
    heading = Heading("The law of what is missing")
    return [*blocks, heading, Paragraph(law.words), Picture("law", caption)]


def _confusion_blocks(diagnosis: Diagnosis) -> list[Block]:
    if not any(effect.confused_with for effect in diagnosis.effects):
        return []
    text = (
        "In trials like these the following effects, each refitted together with the model's own "
        "parameters, leave the same residuals: these data do not identify which of them it is."
    )
    blocks: list[Block] = [Heading("What else it could be"), Paragraph(text)]
    blocks.append(confusion_table(diagnosis.effects))
    for effect in diagnosis.effects:
        for name in (effect.name, *effect.confused_with) if effect.confused_with else ():
            known = CATALOGUE.get(name)
            if known and known.signature:
                text = f"**{effect_name(name)}** would show as: {known.signature}."
                blocks.append(Paragraph(text))
    return blocks


def _next_blocks(diagnosis: Diagnosis) -> list[Block]:
    following = diagnosis.next_experiment
    if following is None:
        return []
    text = f"{capitalised(following.excitation)}."
    if len(following.separates) > 1:
        text += (
            f" It tells {effect_names(following.separates)} apart: expected odds "
            f"{odds(following.expected_odds)} between the two that are hardest to tell."
        )
    elif following.separates:
        text += (
            f" It shows whether {effect_name(following.separates[0])} is there: expected odds "
            f"{odds(following.expected_odds)}."
        )
    text += f" It takes {duration(following.minutes)}; the commands are in `next.csv`."
    return [Heading("The next experiment"), Paragraph(text), Picture("next", "Its commands.")]
