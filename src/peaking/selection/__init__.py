"""View selection: which frames become views.

A policy sees one frame at a time and decides (`policy.py`); one file each. `peaking evaluate`,
`peaking replay` and the live server use the same ones, by name (`registry.py`).
"""
