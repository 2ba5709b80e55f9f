"""Print what flip-evaluator says about the pairs of tests/metric_pairs.py.

Needs `pip install flip-evaluator==1.7`; run as `PYTHONPATH=tests python THIS`. The values
stand in tests/metrics/test_flip.py.
"""

from __future__ import annotations

import importlib

from metric_pairs import metric_pairs


def main() -> None:
    """Print one line per pair and pixels per degree."""
    evaluator = importlib.import_module("flip_evaluator")
    for name, (image, reference) in metric_pairs().items():
        for pixels_per_degree in (67.0, 30.0):
            options = {"ppd": pixels_per_degree}
            value = evaluator.evaluate(reference, image, "LDR", True, False, True, options)[1]
            print(f"({name!r}, {pixels_per_degree}): {value!r},")


if __name__ == "__main__":
    main()
