"""Render the scene `scenes/room`: a living room, photographed all around, with exact geometry.

What it needs, `--only` and `--seed` are described in `make_desk_scene.py`.

    python scripts/make_room_scene.py --out build/room    # then put it in place of scenes/room
"""

from drawn_scenes import room_paths
from drawn_scenes.recording import Files, make_recording, parser
from drawn_scenes.rendering import DrawnScene, build_model
from peaking.photographers.drawn import furniture, living_room
from peaking.photographers.drawn.room_scene import PARTS

PHOTOGRAPHS = Files(quality=73, exact_size_px=(147, 320), marks_overexposed=True)


def main() -> None:
    """Render what was asked for."""
    options = parser(__doc__, seed=23).parse_args()
    scene = DrawnScene(
        build_model(living_room.lights(), PARTS, options.seed),
        mirrors=(living_room.MIRROR,),
        glasses=(living_room.VASE, living_room.SPHERE),
        moving=furniture.BALL,
    )
    make_recording(scene, room_paths.walk(options.seed), PHOTOGRAPHS, options)


if __name__ == "__main__":
    main()
