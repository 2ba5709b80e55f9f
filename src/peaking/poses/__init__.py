"""Where pictures were taken from, estimated from the pictures alone."""
