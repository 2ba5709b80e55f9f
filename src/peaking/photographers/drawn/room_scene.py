# pyright: basic
"""The parts of the living room."""

from peaking.photographers.drawn import furniture, living_room

PARTS = (
    living_room.shell,
    living_room.window,
    living_room.pictures,
    living_room.wall_mirror,
    furniture.black_bookshelf,
    furniture.television,
    furniture.sofa,
    furniture.sideboard,
    furniture.round_table,
    furniture.armchair,
    furniture.lantern_and_plants,
    furniture.beach_ball,
)
