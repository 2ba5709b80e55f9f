"""How long tests wait for what they are about, before they say that it does not come."""

PATIENCE_S = 600.0
"""Many times what is needed on a machine that has much else to do and has compiled nothing yet."""
