"""Print what lpips and stlpips-pytorch say about the pairs of tests/metric_pairs.py.

First with the weights of tests/random_weights.py: these values stand in tests/evaluate/
test_lpips.py. Then with the weights in the packages, beside what peaking says (lpips: its heads
on a random backbone). Needs `pip install torch==2.13.0 torchvision` and, with --no-deps,
lpips==0.1.4 and stlpips-pytorch==0.0.2; run as `PYTHONPATH=tests:src python THIS`.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import Any

from metric_pairs import metric_pairs
from peaking.metrics.lpips import METRICS, _heads_file, _load, _Network
from random_weights import random_weights


def published(name: str, torch: Any) -> Any:
    """Return the published network of a metric, its backbone random if it is of torchvision."""
    if name == "st-lpips-alex":
        for unused in ("IPython", "torchsummary"):  # it imports a name from each and uses neither
            sys.modules[unused] = ModuleType(unused)
            vars(sys.modules[unused]).update(embed=None, summary=None)
        stlpips = importlib.import_module("stlpips_pytorch.stlpips")
        return stlpips.LPIPS(net="alex", variant="shift_tolerant", verbose=False)
    network = importlib.import_module("lpips").LPIPS(
        net=name.removeprefix("lpips-"), pnet_rand=True, verbose=False
    )
    put(network, random_weights(name)[0], torch)
    return network


def put(network: Any, weights: dict[str, Any], torch: Any) -> None:
    """Replace weights of a published network; layers of torchvision are found by their number."""
    state = network.state_dict()
    for key, value in weights.items():
        end = key.removeprefix("features")
        owners = [k for k in state if k == key or (k.startswith("net.") and k.endswith(end))]
        assert len(owners) == 1, (key, owners)
        state[owners[0]] = torch.from_numpy(value)
    network.load_state_dict(state)


def main() -> None:
    """Print one line per metric and pair."""
    torch: Any = importlib.import_module("torch")

    def ask(network: Any, image: Any, reference: Any) -> float:
        a, b = (torch.from_numpy(p).permute(2, 0, 1)[None] for p in (image, reference))
        with torch.inference_mode():
            return float(network(a, b, normalize=True))

    for name, metric in METRICS.items():
        network = published(name, torch)
        weights = _load(_heads_file(metric), metric.heads_sha256)
        if metric.backbone is not None:
            backbone = {k: torch.from_numpy(v) for k, v in random_weights(name)[0].items()}
            weights |= backbone
        ours = _Network(metric.steps, weights)
        for pair, (image, reference) in metric_pairs().items():
            theirs = ask(network, image, reference)
            print(f"# {name} {pair}: {theirs!r}, peaking {ours(image, reference) - theirs:+.1e}")
        for part in random_weights(name):
            put(network, part, torch)
        for pair, (image, reference) in metric_pairs().items():
            print(f"({name!r}, {pair!r}, {ask(network, image, reference)!r}),")


if __name__ == "__main__":
    main()
