"""Recordings and Gaussians in the formats that others read (docs/formats.md).

Each format of data sets is one file with a function that writes a `Material` into a folder, and
returns what a check of its own reads there again. A folder that does not say what it should is not
kept.
"""
