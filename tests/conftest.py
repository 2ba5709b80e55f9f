"""Shapes and types of every annotated function of the package are checked while tests run."""

from collections import Counter
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from jaxtyping import install_import_hook

KERNELS = ("_numba", "_kernels")
"""Modules of compiled functions, which a checker cannot wrap."""

DRAWN = "peaking.photographers.drawn."
"""Where whole numbers stand for floats, as PEP 484 lets them: they describe thousands of places."""

_hook: Any = install_import_hook("peaking", "beartype.beartype").hook
_in_package = _hook.should_instrument


def _should_instrument(name: str) -> bool:
    return _in_package(name) and not name.endswith(KERNELS) and not name.startswith(DRAWN)


_hook.should_instrument = _should_instrument

settings.register_profile(
    "peaking",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],  # that depends on what else the machine does
    report_multiple_bugs=False,
    derandomize=True,
)
settings.load_profile("peaking")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_node_collection_finished(ids: list[str]) -> None:
    """Refuse tests that share an id: pytest-xdist would run one of them."""
    twice = sorted(one for one, count in Counter(ids).items() if count > 1)
    if twice:
        pytest.exit(f"run these without -n, they share ids: {', '.join(twice)}", 4)
