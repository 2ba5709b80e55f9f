"""The virtual photographer: a recording walked frame by frame, and what is written about it.

`run.py` walks; `records.py` holds what it found and writes the files for programs;
`overlay_video.py` draws and `video.py` encodes; `stills.py` picks pictures, `charts.py` and
`path_map.py` draw, and `report.py` puts the page together.
"""
