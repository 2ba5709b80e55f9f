"""Drawn scenes and their parts; see `scripts/make_desk_scene.py` and `make_room_scene.py`."""

import mitsuba

mitsuba.set_variant("llvm_ad_rgb")
