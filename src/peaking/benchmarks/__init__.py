"""How fast the stages are, against named peers in the same run."""
