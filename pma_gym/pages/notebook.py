"""HTML for notebooks: blocks of a report as a fragment with its own style."""

from collections.abc import Mapping, Sequence

from pma_gym.pages.document import Block, html_block
from pma_gym.printable import printable

# Colours come from the notebook, so that they fit its light and its dark theme.
_STYLE = """<style>
.pma-gym { max-width: 60rem; }
.pma-gym .callout { border-left: 5px solid #0072b2; padding: .2rem 0 .2rem .9rem; margin: .4rem 0; }
.pma-gym .callout.good { border-color: #009e73; }
.pma-gym .callout.bad { border-color: #d55e00; }
.pma-gym .callout .large { font-weight: 600; }
.pma-gym .wide { overflow-x: auto; }
.pma-gym caption { text-align: left; font-weight: 600; caption-side: top; color: inherit; }
.pma-gym tbody th { text-align: left; font-weight: 400; }
.pma-gym figure { margin: .4rem 0; }
.pma-gym img { max-width: 100%; height: auto; background: #fff; }
</style>"""


def notebook_html(blocks: Sequence[Block], pictures: Mapping[str, bytes] | None = None) -> str:
    """Render blocks as the HTML that `_repr_html_` returns.

    Args:
        blocks: what is shown.
        pictures: PNG by name; one that is missing is left out.
    """
    body = "\n".join(html_block(block, pictures or {}) for block in blocks)
    return f'{_STYLE}\n<div class="pma-gym">\n{printable(body)}\n</div>'
