# pyright: basic
"""The parts of the desk scene; each has its own generator, so that one can change alone."""

from peaking.photographers.drawn import desk_room, desk_things

PARTS = (
    desk_room.room,
    desk_room.bookshelf,
    desk_room.far_furniture,
    desk_things.desk,
    desk_things.near_plant,
    desk_things.computer,
    desk_things.papers,
    desk_things.small_things,
    desk_things.mirror_and_glass,
)
