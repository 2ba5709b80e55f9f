"""Time a depth model by every `--depth-runtime`, in turn, and say how far the outcomes differ.

.venv/bin/python scripts/time_depth_runtimes.py --rounds 15 [--model FOLDER]

Without a model, Depth Anything V2 Small of random weights: the arithmetic is the same as of trained
ones. Needs the extra openvino.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from pathlib import Path

import numpy as np
import torch
from transformers import (
    AutoModelForDepthEstimation,
    DepthAnythingConfig,
    DepthAnythingForDepthEstimation,
    Dinov2Config,
)

from peaking.depth.hub import HubDepth, Preparation

SIZES_PX = ((294, 639), (518, 518))
LAYOUT = "default layout"


def random_small(folder: Path) -> Path:
    """Write a Small with random weights."""
    backbone = Dinov2Config(
        hidden_size=384,
        num_attention_heads=6,
        image_size=518,
        patch_size=14,
        out_features=["stage3", "stage6", "stage9", "stage12"],
        reshape_hidden_states=False,
    )
    config = DepthAnythingConfig(backbone_config=backbone, head_hidden_size=32)
    torch.manual_seed(0)
    model = DepthAnythingForDepthEstimation(config)
    with torch.no_grad():
        for name, values in model.named_parameters():
            if name.startswith(("neck", "head")):  # else hardly anything comes through
                values.normal_(0, 0.1)
    model.save_pretrained(folder)
    size = {"size": {"height": 518, "width": 518}, "keep_aspect_ratio": True}
    text = json.dumps({**size, "ensure_multiple_of": 14})
    (folder / "preprocessor_config.json").write_text(text)
    return folder


def in_default_layout(folder: Path) -> HubDepth:
    """Return the model as transformers runs it, not brought to channels last."""
    model = AutoModelForDepthEstimation.from_pretrained(folder, local_files_only=True).eval()

    def run(shown: np.ndarray) -> np.ndarray:
        with torch.inference_mode():
            return model(torch.from_numpy(shown)).predicted_depth[0].numpy()

    preparation = Preparation.read(folder / "preprocessor_config.json")
    return HubDepth(run, preparation, name=folder.name, metric=False)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--model", type=Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        os.environ["PEAKING_CHECKPOINTS"] = scratch
        model = arguments.model or random_small(Path(scratch) / "small")
        ways = {LAYOUT: in_default_layout(model)}
        ways |= {
            runtime: HubDepth.load(model, runtime=runtime)
            for runtime in ("pytorch", "openvino", "openvino-bf16")
        }
        for width_px, height_px in SIZES_PX:
            shape = (height_px, width_px, 3)
            rgb = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
            said = {name: way(rgb) for name, way in ways.items()}
            wall_s = {name: [] for name in ways}
            cpu_s = {name: [] for name in ways}
            for _ in range(arguments.rounds):
                for name, way in ways.items():
                    wall, cpu = time.perf_counter(), time.process_time()
                    way(rgb)
                    cpu_s[name].append(time.process_time() - cpu)
                    wall_s[name].append(time.perf_counter() - wall)
            reference = said[LAYOUT]
            for name in ways:
                wall, cpu = (np.median(times[name]) for times in (wall_s, cpu_s))
                wall_by, cpu_by = (
                    np.median(times[LAYOUT]) / np.median(times[name]) for times in (wall_s, cpu_s)
                )
                off = np.abs(said[name] - reference) / np.ptp(reference)
                print(
                    f"{width_px}x{height_px} {name:14s} processor {cpu:.2f} s, {cpu_by:.2f}x; "
                    f"wall {wall:.2f} s, {wall_by:.2f}x; differs {off.max():.1e}, "
                    f"{np.median(off):.1e}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
