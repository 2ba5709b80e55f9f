"""One file per subcommand: its arguments as a dataclass, and `run`.

Only light modules are imported at the top, so that `peaking --help` is quick.
"""
