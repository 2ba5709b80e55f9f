# pyright: basic
"""The parts of the desk scene; each has its own generator, so that one can change alone."""

from peaking.photographers.drawn import desk, desk_room

PARTS = (
    desk_room.room,
    desk_room.bookshelf,
    desk_room.far_furniture,
    desk.desk,
    desk.near_plant,
    desk.computer,
    desk.papers,
    desk.small_things,
    desk.mirror_and_glass,
)
