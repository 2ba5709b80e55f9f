"""Shapes and types of every annotated function of the package are checked while tests run."""

from typing import Any

import pytest
from hypothesis import settings
from jaxtyping import install_import_hook

KERNELS = ("_numba", "_kernels")
"""Modules of compiled functions, which a checker cannot wrap."""

_hook: Any = install_import_hook("peaking", "beartype.beartype").hook
_in_package = _hook.should_instrument


def _should_instrument(name: str) -> bool:
    return _in_package(name) and not name.endswith(KERNELS)


_hook.should_instrument = _should_instrument

settings.register_profile("peaking", deadline=None, report_multiple_bugs=False, derandomize=True)
settings.load_profile("peaking")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Refuse tests that share an id where pytest-xdist is at work: it would run one of them."""
    ids = [item.nodeid for item in items]
    twice = {one for one in ids if ids.count(one) > 1} if len(set(ids)) < len(ids) else set[str]()
    if twice and hasattr(config, "workerinput"):
        raise pytest.UsageError(f"run these without -n, they share ids: {', '.join(sorted(twice))}")
