# pyright: basic
"""Drawn scenes as plain data: meshes, textures, materials, lights.

`scripts/make_desk_scene.py` and `make_room_scene.py` path-trace them with Mitsuba 3;
`peaking.photographers.scene` bakes their light and draws them from anywhere within milliseconds.
Materials and lights are called what Mitsuba calls them.
"""
