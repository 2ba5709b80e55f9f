"""Replay a recording frame by frame: capture by a policy, and write a video and a report.

`run.py` is the loop; `records.py` holds the results and writes the files for programs;
`overlay_video.py` draws and `video.py` encodes the video; `stills.py` chooses pictures, `charts.py`
and `path_map_svg.py` draw, and `report.py` writes the page.
"""
