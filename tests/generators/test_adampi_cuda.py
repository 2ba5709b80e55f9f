from __future__ import annotations

from collections.abc import Callable

import pytest
import torch

from adampi_on_cuda import CHECKS


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_on_cuda(check: Callable[[], object]) -> None:
    assert check()
