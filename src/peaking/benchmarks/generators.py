"""How long generators take for one picture, and how much memory: `peaking bench generators`.

The network's weights are random: the arithmetic, and so the time, is that of trained ones. Every
way of running it is a process of its own, so that its peak of memory is its own; the ways take
turns.
"""

# PyTorch is typed only in part.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from peaking.benchmarks.measure import machine

WIDTH_PX, HEIGHT_PX, NUM_PLANES = 384, 640, 32
"""The size of the network for the paper's 294×639 (multiples of 128)."""

CPU_WAYS = ("plain", "ours")
"""The reference module as it is, and `cpu.py`."""

CUDA_WAYS = (
    "cuda float32 all planes",
    "cuda float32 in eights",
    "cuda bfloat16 all planes",
    "cuda float16 all planes",
    "cuda float32 whole step",
    "cuda bfloat16 whole step",
)


@dataclass(frozen=True)
class Run:
    """What one process measured.

    Attributes:
        wall_s: By the clock; the least of its rounds.
        cpu_s: Of the processor, over all threads, in the same round; 0 on CUDA.
        peak_gb: Most memory that it had (of the graphics card on CUDA).
    """

    wall_s: float
    cpu_s: float
    peak_gb: float


def run(*, rounds: int, progress: Callable[[list[str]], Iterable[str]] = iter) -> dict[str, object]:
    """Measure all ways in turn and return the results file."""
    import torch

    ways = [*CPU_WAYS, *(CUDA_WAYS if torch.cuda.is_available() else ())]
    runs: dict[str, list[Run]] = {way: [] for way in ways}
    for way in progress(ways * rounds):
        done = subprocess.run(
            [sys.executable, "-m", "peaking.benchmarks.generators", way],
            capture_output=True,
            text=True,
            check=True,
        )
        runs[way].append(Run(**json.loads(done.stdout.splitlines()[-1])))
    plain = [sample.cpu_s for sample in runs["plain"]]
    return {
        "machine": machine() | ({"gpu": torch.cuda.get_device_name()} if len(ways) > 2 else {}),
        "torch": torch.__version__,
        "threads": torch.get_num_threads(),
        "size": f"{WIDTH_PX}x{HEIGHT_PX}x{NUM_PLANES}",
        "results": [
            {
                "name": way,
                "wall_s": round(float(np.median([sample.wall_s for sample in samples])), 4),
                "cpu_s": round(float(np.median([sample.cpu_s for sample in samples])), 3),
                "peak_gb": round(max(sample.peak_gb for sample in samples), 2),
                "times_faster_than_plain_by_cpu_time": (
                    round(float(np.median(plain) / np.median([s.cpu_s for s in samples])), 2)
                    if way in CPU_WAYS
                    else None
                ),
                "rounds": len(samples),
            }
            for way, samples in runs.items()
        ],
    }


def measure(way: str) -> Run:
    """Measure one way, in this process."""
    import torch

    from peaking.generators.adampi.chunked import Chunks, forward_in_chunks
    from peaking.generators.adampi.cpu import forward_on_cpu
    from peaking.generators.adampi.network import random_network

    network = random_network(1)
    drawn = torch.rand(1, 4, HEIGHT_PX, WIDTH_PX, generator=torch.Generator().manual_seed(1))
    rgb, disparity = drawn[:, :3].contiguous(), drawn[:, 3:].contiguous()
    with torch.inference_mode():
        if way == "plain":
            return _timed_on_cpu(lambda: network(rgb, disparity, NUM_PLANES))
        if way == "ours":
            return _timed_on_cpu(lambda: forward_on_cpu(network, rgb, disparity, NUM_PLANES))
        _, precision, *how = way.split()
        if how == ["whole", "step"]:
            return _timed_on_cuda(_whole_step(precision))
        network = network.cuda()
        on_card = rgb.cuda(), disparity.cuda()
        chunks = Chunks(8 if how == ["in", "eights"] else NUM_PLANES)
        return _timed_on_cuda(
            lambda: forward_in_chunks(
                network,
                *on_card,
                NUM_PLANES,
                chunks=chunks,
                precision=precision,  # type: ignore[arg-type]
            )
        )


def _whole_step(precision: str) -> Callable[[], object]:
    """Return picture and depth to sparse MPI, at the paper's size."""
    from peaking.generators.adampi.checkpoint import Checkpoint
    from peaking.generators.adampi.generator import AdaMpi
    from peaking.generators.adampi.network import random_network
    from peaking.geometry import Camera, Pinhole, Rigid

    width, height = 294, 639
    generator = AdaMpi(
        Checkpoint(random_network(1), NUM_PLANES),
        device="cuda",
        precision=precision,  # type: ignore[arg-type]
    )
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    rgb = np.stack([x % 256, y % 256, (x + y) % 256], axis=-1).astype(np.uint8)
    depth_m = (1.5 + 0.5 * np.sin(x / 40) * np.cos(y / 60)).astype(np.float32)
    camera = Camera(Pinhole(width, height, 350.0, 350.0, width / 2, height / 2), Rigid.identity())
    return lambda: generator(rgb, depth_m, camera)


def _timed_on_cpu(work: Callable[[], object]) -> Run:
    samples: list[Run] = []
    for _ in range(2):  # the first one warms up
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        work()
        samples.append(Run(time.perf_counter() - wall_s, time.process_time() - cpu_s, 0.0))
    peak_gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    return Run(samples[-1].wall_s, samples[-1].cpu_s, peak_gb)


def _timed_on_cuda(work: Callable[[], object]) -> Run:
    import torch

    walls_s: list[float] = []
    for _ in range(12):  # the first two warm up
        torch.cuda.synchronize()
        start_s = time.perf_counter()
        work()
        torch.cuda.synchronize()
        walls_s.append(time.perf_counter() - start_s)
    return Run(float(np.median(walls_s[2:])), 0.0, torch.cuda.max_memory_allocated() / 1e9)


if __name__ == "__main__":
    measured = measure(sys.argv[1])
    os.write(1, (json.dumps(vars(measured)) + "\n").encode())
