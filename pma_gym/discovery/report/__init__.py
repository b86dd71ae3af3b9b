"""A diagnosis as text, tables, pictures and a page."""

import warnings
from typing import Any


def __getattr__(name: str) -> Any:  # noqa: ANN401 - what the page's module holds
    """Names of the page by their old place, `pma_gym.discovery.report`."""
    # Before the import below, which asks for the module `page` by this very function.
    if name not in ("report_page", "report_blocks", "report_pictures"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from pma_gym.discovery.report import page

    warnings.warn(
        f"{name} is now in {page.__name__}; import it from there",
        DeprecationWarning,
        stacklevel=2,
    )
    return getattr(page, name)
