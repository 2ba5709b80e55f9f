"""Checks of the CUDA path that need no test runner: a machine with a GPU may have none.

PYTHONPATH=src python tests/adampi_on_cuda.py
"""

from __future__ import annotations

import logging

import numpy as np
import torch

from peaking.generators.adampi.checkpoint import Checkpoint
from peaking.generators.adampi.chunked import Chunks, forward_in_chunks
from peaking.generators.adampi.generator import AdaMpi
from peaking.generators.adampi.network import random_network
from peaking.geometry import Camera, Pinhole, Rigid
from peaking.mpi import Mpi
from peaking.options import Precision
from peaking.rendering import render

SAME_AS_PROCESSOR = 5e-3
"""Of densities up to 11; TF32 is off. 9.6e-4 on an H100 (PyTorch 2.11)."""

MIN_PSNR_DB = {"float32": 55.0, "bfloat16": 48.0, "float16": 54.0}
"""Of the MPI made on CUDA, rendered 5 cm aside, against the one made on a processor; 62.6, 55.0 and
61.5 dB on an H100, in two runs. float32 has PyTorch's default, TF32, for its convolutions."""

NUM_PLANES = 8


def made_on(device: str, precision: Precision = "float32") -> Mpi:
    """Return the MPI of a small scene."""
    width, height = 200, 150
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    rgb = np.stack([x, y, (x + y) / 2], axis=-1).astype(np.uint8)
    depth_m = (1.5 + 0.5 * np.sin(x / 40) * np.cos(y / 60)).astype(np.float32)
    camera = Camera(Pinhole(width, height, 180.0, 180.0, width / 2, height / 2), Rigid.identity())
    checkpoint = Checkpoint(random_network(1), NUM_PLANES)
    if device == "cpu":
        return AdaMpi(checkpoint, device="cpu")(rgb, depth_m, camera)
    return AdaMpi(checkpoint, device="cuda", precision=precision)(rgb, depth_m, camera)


def check_float32_says_what_a_processor_says() -> float:
    """Compare layers; return the largest difference."""
    drawn = torch.rand(1, 4, 128, 256, generator=torch.Generator().manual_seed(4))
    rgb, disparity = drawn[:, :3], drawn[:, 3:]
    with torch.inference_mode():
        expected = random_network(1)(rgb, disparity, 4)
        torch.backends.cudnn.allow_tf32 = False
        made = forward_in_chunks(
            random_network(1).cuda(), rgb.cuda(), disparity.cuda(), 4, chunks=Chunks(2)
        )
        torch.backends.cudnn.allow_tf32 = True
    worst = float((made.colour_density.cpu() - expected.colour_density).abs().max())
    assert worst < SAME_AS_PROCESSOR, worst
    return worst


def check_views_agree_in_every_precision() -> dict[str, float]:
    """Render MPIs aside; return the PSNR of each precision."""
    reference = made_on("cpu")
    aside = Camera(reference.camera.pinhole, Rigid(np.eye(3), np.array([0.05, 0.0, 0.0])))
    expected = render(reference, aside).rgba[..., :3]
    psnr_db: dict[str, float] = {}
    precisions: tuple[Precision, ...] = ("float32", "bfloat16", "float16")
    for precision in precisions:
        seen = render(made_on("cuda", precision), aside).rgba[..., :3]
        error = max(float(np.mean((seen - expected) ** 2)), 1e-12)
        psnr_db[precision] = -10 * float(np.log10(error))
        assert psnr_db[precision] > MIN_PSNR_DB[precision], psnr_db
    return psnr_db


def check_it_goes_on_in_chunks_where_memory_is_short() -> int:
    """Take most of the card's memory away; return how many planes fitted at once."""
    network = random_network(1).cuda()
    rgb, disparity = torch.rand(1, 3, 640, 384).cuda(), torch.rand(1, 1, 640, 384).cuda()
    total = torch.cuda.get_device_properties(0).total_memory
    torch.cuda.empty_cache()
    torch.cuda.set_per_process_memory_fraction(1.5e9 / total)
    chunks = Chunks(32)
    try:
        with torch.inference_mode():
            made = chunks.fitting(
                lambda: forward_in_chunks(network, rgb, disparity, 32, chunks=chunks)
            )
    finally:
        torch.cuda.set_per_process_memory_fraction(1.0)
    assert made.colour_density.shape == (32, 4, 640, 384)
    assert chunks.planes_at_once < 32
    return chunks.planes_at_once


CHECKS = (
    check_float32_says_what_a_processor_says,
    check_views_agree_in_every_precision,
    check_it_goes_on_in_chunks_where_memory_is_short,
)

if __name__ == "__main__":
    logging.basicConfig(level=logging.WARNING)
    for check in CHECKS:
        print(check.__name__, check())  # noqa: T201
