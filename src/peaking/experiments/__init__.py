"""View-selection experiments: steps, runner, intervals, reports."""
