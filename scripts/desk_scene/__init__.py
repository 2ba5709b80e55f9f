"""The parts of the sample scene; see `scripts/make_desk_scene.py`."""
