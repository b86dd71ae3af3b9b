"""A browser, and pages to look at: Debian's Chromium, driven by Playwright."""

import shutil

import pytest

WIDTHS = {"phone": 360, "desk": 1280}


_SIDEWAYS = """[...document.querySelectorAll("*")].filter(each => each.clientWidth > 0
  && each.scrollWidth > each.clientWidth + 1
  && (each === document.documentElement
      || ["auto", "scroll"].includes(getComputedStyle(each).overflowX)))
  .map(each => `${each.tagName}.${each.className}`)"""


def sideways(page):
    """What scrolls sideways: the page, or a part of it."""
    return page.evaluate(_SIDEWAYS)


@pytest.fixture(scope="session")
def chromium():
    """The browser; skipped where there is none."""
    api = pytest.importorskip("playwright.sync_api", reason="pip install playwright")
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("there is no chromium; on Debian: apt-get install chromium")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture(params=["light", "dark"])
def scheme(request):
    """Colours that the reader prefers."""
    return request.param


@pytest.fixture
def open_page(chromium):
    """Opens an address at a width: the page, and all that went wrong on it."""
    contexts = []

    def open_page(address, width="desk", scheme="light"):
        size = {"width": WIDTHS[width], "height": 800}
        context = chromium.new_context(viewport=size, color_scheme=scheme)
        contexts.append(context)
        page = context.new_page()
        faults = []
        page.on("console", lambda m: faults.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.goto(address)
        page.wait_for_load_state("load")
        return page, faults

    yield open_page
    for context in contexts:
        context.close()
