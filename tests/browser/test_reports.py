"""Reports in a browser: nothing fails, figures respond, a phone needs no sideways scroll.

The built documentation in a browser: nothing fails, a phone needs no sideways scroll.
"""

import io
import json
import subprocess
import sys
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from PIL import Image

from benchmarks.report.publish import run_report
from pma_gym.discovery.report.page import report_page
from tests.benchmarks.report.test_leaderboard import write_run
from tests.benchmarks.reproduction.test_report import run, suite  # noqa: F401 - fixtures
from tests.browser.conftest import sideways
from tests.discovery.conftest import *  # noqa: F403 - fixtures

pytestmark = pytest.mark.browser
MOST_BYTES = 5_000_000


@pytest.fixture(scope="module")
def reports(tmp_path_factory, diagnoses, run):  # noqa: F811
    """Files of a leaderboard, of a diagnosis and of a reproduction, by name."""
    tmp_path = tmp_path_factory.mktemp("reports")
    small, results = write_run(tmp_path)
    page = tmp_path / "diagnosis.html"
    page.write_text(report_page(diagnoses["effect"], "Rig 2", {"Seed": "3"}), encoding="utf-8")
    board, *_ = run_report(small, results, tmp_path / "board")
    return {"leaderboard": board, "diagnosis": page, "reproduction": run[1] / "report.html"}


@pytest.fixture(params=["leaderboard", "diagnosis", "reproduction"])
def report(request, reports):
    return reports[request.param]


def test_no_error_and_no_sideways_scroll(report, open_page, scheme):
    for width in ("phone", "desk"):
        page, faults = open_page(report.as_uri(), width, scheme)
        assert faults == []
        if width == "phone":
            assert sideways(page) == []
        assert page.locator(".plot .main-svg").count() > 0


def test_colours_follow_the_reader(report, open_page):
    paper = {}
    for scheme in ("light", "dark"):
        page, _ = open_page(report.as_uri(), scheme=scheme)
        paper[scheme] = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert paper == {"light": "rgb(255, 255, 255)", "dark": "rgb(21, 25, 30)"}


def test_pictures_follow_the_colours_of_the_reader(reports, open_page):
    # The corner of a picture is its background, which is that of the page.
    paper = {"light": (255, 255, 255), "dark": (21, 25, 30)}
    for scheme, colour in paper.items():
        page, _ = open_page(reports["leaderboard"].as_uri(), scheme=scheme)
        shown = page.locator("figure img").first.screenshot()
        corner = Image.open(io.BytesIO(shown)).convert("RGB").getpixel((3, 3))
        assert corner == pytest.approx(colour, abs=3), scheme


def test_a_figure_zooms_hovers_and_filters(report, open_page):
    page, faults = open_page(report.as_uri())
    plot = page.locator(".plot").first
    plot.scroll_into_view_if_needed()
    before = plot.evaluate("p => [...p._fullLayout.xaxis.range]")
    box = plot.locator(".nsewdrag").bounding_box()
    left, top = box["x"] + 0.3 * box["width"], box["y"] + 0.3 * box["height"]
    page.mouse.move(left, top)
    page.mouse.down()
    page.mouse.move(left + 0.3 * box["width"], top + 0.4 * box["height"], steps=5)
    page.mouse.up()
    page.wait_for_timeout(500)
    after = plot.evaluate("p => [...p._fullLayout.xaxis.range]")
    assert after[1] - after[0] < 0.5 * (before[1] - before[0])
    plot.locator(".legendtoggle").first.click()
    page.wait_for_timeout(800)
    assert "legendonly" in plot.evaluate("p => p._fullData.map(t => t.visible)")
    plot.evaluate("p => Plotly.Fx.hover(p, [{curveNumber: 1, pointNumber: 1}])")
    assert plot.locator(".hoverlayer .hovertext").count() > 0
    assert faults == []


def test_a_menu_picks_what_a_figure_shows(reports, open_page):
    page, faults = open_page(reports["reproduction"].as_uri())
    plot, menu = page.locator("#figure-tracking-displacement"), page.locator(".pick select").first
    assert menu.input_value() == "error at 350 kPa (mm)"
    menu.select_option("motor voltage at 350 kPa (V)")
    assert plot.evaluate("p => p._fullLayout.yaxis.title.text") == "motor voltage at 350 kPa (V)"
    names = plot.evaluate("p => p._fullData.map(trace => trace.name)")
    assert "Half" in names and "Ideal" not in names
    assert faults == []


def test_a_page_stays_small_and_loads_nothing(report, open_page):
    assert report.stat().st_size < MOST_BYTES
    page, _ = open_page(report.as_uri())
    loaded = page.evaluate("performance.getEntriesByType('resource').map(e => e.name)")
    assert [name for name in loaded if not name.startswith(("data:", "file:"))] == []


def test_print_has_pictures_and_no_interactive_figure(report, open_page):
    page, _ = open_page(report.as_uri())
    page.emulate_media(media="print")
    assert page.locator(".interactive").first.is_hidden()
    assert page.locator("figure img").first.is_visible()
    if page.locator(".printed").count():
        page.emulate_media(media="screen")
        assert page.locator(".printed").first.is_hidden()
        page.emulate_media(media="print")
    page.set_viewport_size({"width": 718, "height": 1000})  # A4 less margins, at 96 pixels an inch.
    wide = page.evaluate(
        "[...document.querySelectorAll('table, img')].map(e => e.getBoundingClientRect().right)"
    )
    assert max(wide) <= 718, json.dumps(wide)


ROOT = Path(__file__).resolve().parents[2]


class Quiet(SimpleHTTPRequestHandler):
    """Serves a folder and says nothing."""

    def log_message(self, *words):
        pass


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Address and folder of the documentation, built and served here."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "-d", folder]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}", folder
    server.shutdown()
    server.server_close()


def test_every_page_loads_without_error_and_fits_a_phone(site, open_page):
    address, folder = site
    names = [each.parent.relative_to(folder).as_posix() for each in folder.rglob("index.html")]
    assert len(names) > 30
    broken = {}
    for name in names:
        page, faults = open_page(f"{address}/{name}/", "phone")
        wide = sideways(page)
        if faults or wide:
            broken[name] = (faults, wide)
        page.context.close()
    assert broken == {}
