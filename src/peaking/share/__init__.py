"""What was captured, as a place to walk in: files that a browser shows without a server of ours."""
