"""The server: takes captures in, makes MPIs, tells phones; see `docs/protocol.md`."""
