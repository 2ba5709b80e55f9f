"""See in red, while you photograph, which pixels view synthesis still gets wrong.

Start with `peaking.pipeline`: the whole method on one screen. Conventions: CONVENTIONS.md.
"""

__version__ = "0.2.0.dev0"
