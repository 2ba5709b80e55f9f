"""How good views are: metrics, peers, benchmarks."""
