"""Render the sample scenes of an office desk, with exact geometry: a video and photographs.

`--recording desk` is `scenes/desk`, filmed by a phone that moves past; `around` is
`scenes/desk_around`, the same desk photographed from all over, with a duck that will not stand
still, and with pictures that are held out.

A developer's tool; nothing in the package needs it. It runs on a CPU (a frame takes about
6 s on two cores). The same `--seed` gives the same scene; repeated runs gave the
same depth and labels, and pictures the same but for rounding (mostly none, at worst 7 grey levels
in single pixels). What it needs:

    apt-get install libllvm19        # LLVM 14 to 16 do not work
    pip install mitsuba==3.9.1 mitsuba-oidn==0.1.2 opencv-python-headless==5.0.0.93 -e .

    python scripts/make_desk_scene.py --out build/desk    # then put it in place of scenes/desk
    python scripts/make_desk_scene.py --recording around --out build/desk_around

`--only 30:60` renders frames 30 to 59 and keeps the others: so an interrupted run goes on.
`transforms.json` is written in any case and always lists every frame.
"""

from drawn_scenes import desk_paths
from drawn_scenes.duck import DUCK, duck
from drawn_scenes.recording import Files, make_recording, parser
from drawn_scenes.rendering import DrawnScene, build_model
from peaking.photographers.drawn import desk_room
from peaking.photographers.drawn.desk_scene import PARTS

VIDEO = Files(quality=80)
PHOTOGRAPHS = Files(quality=73, exact_size_px=(147, 320), marks_overexposed=True)


def main() -> None:
    """Render what was asked for."""
    line = parser(__doc__, seed=7)
    line.add_argument("--recording", choices=("desk", "around"), default="desk")
    line.add_argument("--frames", type=int, default=150, help="frames of the video")
    options = line.parse_args()
    lights, special = desk_room.lights(), ((desk_room.MIRROR,), (desk_room.GLASS,))
    if options.recording == "desk":
        scene = DrawnScene(build_model(lights, PARTS, options.seed), *special)
        make_recording(scene, desk_paths.sweep(options.frames, options.seed), VIDEO, options)
    else:
        scene = DrawnScene(build_model(lights, (*PARTS, duck), options.seed), *special, DUCK)
        make_recording(scene, desk_paths.around(options.seed), PHOTOGRAPHS, options)


if __name__ == "__main__":
    main()
