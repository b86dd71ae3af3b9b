"""The page of a diagnosis: whole, self-contained, in words, for every verdict."""

import re
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser

import numpy as np
import pytest

from pma_gym.discovery.report import latent_picture
from pma_gym.discovery.report.curves import worst_trial
from pma_gym.discovery.report.effect_text import effect_equation, effect_summary
from pma_gym.discovery.report.page import report_blocks, report_page, report_pictures
from pma_gym.discovery.result.misfit import LatentForce, TrialRecord
from pma_gym.effects import CATALOGUE
from pma_gym.pages.document import Heading, Picture, to_markdown

VERDICTS = ("effect", "parameters", "agrees", "unknown", "undecidable")


class Tags(HTMLParser):
    """Checks that tags nest, and gathers what the page loads."""

    def __init__(self):
        super().__init__()
        self.open, self.loaded = [], []

    def handle_starttag(self, tag, attributes):
        self.loaded += [value for name, value in attributes if name in ("src", "href")]
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture(scope="module", autouse=True)
def small_pictures():
    """Pictures of a third of the size, which are drawn in half the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pma_gym.pages.figures.DPI", 50)
        yield


@pytest.fixture(scope="module")
def pictures(diagnoses):
    """The pictures of a verdict's diagnosis; they take most of a second, so they are kept."""
    return cache(lambda verdict: report_pictures(diagnoses[verdict]))


@pytest.fixture(scope="module")
def page_of(diagnoses):
    """The page of a verdict's diagnosis, kept as its pictures are."""
    return cache(lambda verdict: report_page(diagnoses[verdict], "Rig 2", {"Seed": "3"}))


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_page_needs_nothing_else_and_says_the_verdict_first(diagnoses, page_of, verdict):
    diagnosis, page = diagnoses[verdict], page_of(verdict)
    tags = Tags()
    tags.feed(page)
    assert not tags.open
    assert all(each.startswith("data:image/png;base64,") for each in tags.loaded)
    text = re.sub(r"<[^>]+>", " ", page.rpartition("<body>")[2])
    assert text.index(diagnosis.sentence) < text.index("What to do now")
    assert not re.search(r"\bnan\b|None|\{|_friction", re.sub(r"[\w.]+_n_\w+", "", text))
    assert "Seed" in text


@pytest.mark.parametrize("verdict", ["effect", "unknown"])
def test_every_picture_stands_on_the_page(diagnoses, pictures, verdict):
    drawn, blocks = pictures(verdict), report_blocks(diagnoses[verdict], "", {})
    assert drawn and set(drawn) <= {block.name for block in blocks if isinstance(block, Picture)}
    markdown = to_markdown(blocks, drawn, "pictures")
    assert markdown.count("![") == len(drawn)
    assert markdown.startswith(f"# {blocks[0].text}")
    # The same diagnosis gives the same pictures.
    assert verdict == "effect" or report_pictures(diagnoses[verdict]) == drawn


def test_the_order_of_the_page(example):
    named = [block.text for block in report_blocks(example, "", {}) if isinstance(block, Heading)]
    assert named[:8] == [
        "An effect is missing",
        "What to do now",
        "Where they disagree",
        "Before and after",
        "The worst trial",
        "The effect: Coulomb friction",
        "What else it could be",
        "The next experiment",
    ]
    assert named[8] == "How it was decided"


def test_the_effect_comes_with_equation_size_and_rivals(page_of):
    page = page_of("effect")
    assert "F = -k f(v) z" in page and "Dry friction of the slide" in page
    for text in ("19.1 to 21.4", "below 22", "hysteresis", "p &lt; 0.001", "about 40 to 1"):
        assert text in page


def test_the_worst_trial_is_the_one_missed_by_most(example):
    def missed(trial):
        return max(gap.before / gap.floor for gap in trial.gaps.values())

    assert worst_trial(example) == max(example.trials, key=missed)


@pytest.mark.parametrize("added", [True, False])
def test_the_latent_force_is_drawn_over_all_that_it_may_go_with(diagnoses, monkeypatch, added):
    time, rest = np.linspace(0.0, 9.0, 2500), np.full((2500, 1), np.nan)
    over = {name: np.sin(time) for name in ("contraction (mm)", "speed (mm/s)", "load (N)")}
    trials = []
    for size in (2.0, 8.0):
        after = np.ones(2500) if added else None
        force = LatentForce("force on the slide (N)", np.full(2500, size), after, over)
        trials.append(TrialRecord(f"{size}.csv", time, *[rest] * 4, {}, False, latent=force))
    diagnosis = replace(diagnoses["unknown"], trials=tuple(trials))
    pictures = report_pictures(diagnosis)
    assert 'alt="Smoothed latent force' in report_page(diagnosis) and "law" not in pictures
    monkeypatch.setattr(latent_picture, "png", lambda figure: figure)
    first, *panels, sizes = latent_picture.latent_picture(diagnosis).axes
    assert first.get_title("left") == "8.0.csv"
    lines = {panel.get_xlabel(): panel.get_lines() for panel in panels}
    assert set(lines) == {"time (s)", *over}
    # Before, perhaps after, zero, and the law where it belongs.
    for name, drawn in lines.items():
        assert len(drawn) == 2 + added + (name == diagnosis.law.variable)
        assert all(len(line.get_xdata()) <= 1000 for line in drawn)
    assert {panel.get_ylabel() for panel in panels} == {"force\non the slide (N)"}
    assert [bar.get_width() for bar in sizes.patches] == [8.0, 2.0] + [1.0, 1.0] * added


@pytest.mark.parametrize("name", CATALOGUE)
def test_every_effect_has_words(name):
    if CATALOGUE[name].law is not None:
        assert effect_summary(name).endswith(".")
        effect_equation(name)


@pytest.mark.parametrize("verdict", VERDICTS)
def test_a_notebook_shows_the_sentence_the_gap_and_the_effects(diagnoses, verdict):
    diagnosis = diagnoses[verdict]
    shown = diagnosis._repr_html_()
    tags = Tags()
    tags.feed(shown)
    assert not tags.open
    assert diagnosis.sentence in shown
    for signal, gap in diagnosis.gap.items():
        assert signal in shown and f"{gap.after:.3g}" in shown
    for effect in diagnosis.effects:
        assert effect.name in shown and set(effect.parameters) <= set(re.findall(r"\w+", shown))
