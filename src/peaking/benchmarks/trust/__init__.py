"""Can red be trusted? Measured where the truth is known."""
