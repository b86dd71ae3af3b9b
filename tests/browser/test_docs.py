"""The built documentation in a browser: nothing fails, a phone needs no sideways scroll."""

import subprocess
import sys
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from tests.browser.conftest import sideways

pytestmark = pytest.mark.browser
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
