"""The `peaking` command and its subcommands."""

from __future__ import annotations

import functools
import inspect
import os
import sys
from collections.abc import Sequence
from typing import Annotated, Any, Protocol, runtime_checkable

import tyro

import peaking
from peaking.commands import (
    bench,
    bench_doctor,
    bench_generators,
    bench_guidance,
    bench_live,
    bench_trust,
    bench_view,
    checkpoints,
    convert,
    demo,
    devices,
    doctor,
    evaluate,
    generate,
    info,
    photographers,
    plan,
    quality,
    render,
    replay,
    select,
    serve,
    share,
    splat,
    study,
    view,
)
from peaking.commands.arguments import with_plain_help
from peaking.errors import PeakingError
from peaking.terminal import say, show_fault

DESCRIPTION = """See in red, while you photograph, which pixels view synthesis still gets wrong.

Examples:
  peaking demo
  peaking serve ~/captures
  peaking devices ~/captures
  peaking study init study
  peaking replay scenes/desk --out out/desk
  peaking replay scenes/desk --out out/paper --preset paper --overlay video
  peaking select scenes/desk --views 12 --out out/best
  peaking info scenes/desk
  peaking doctor scenes/desk --out out/doctor
  peaking convert scenes/desk out/colmap --to colmap
  peaking generate scenes/desk --frame 0 --out view.mpi
  peaking render view.mpi --move-m 0.1 0 0 --out moved.png
  peaking splat scenes/desk --out desk.ply
  peaking view scenes/desk
  peaking share scenes/desk --out desk.html
  peaking plan --z-min-m 0.5 --area-m 0.15
  peaking evaluate scenes/desk --out out/evaluation
  peaking photographers --json photographers.json
  peaking quality scenes/desk
  peaking checkpoints
  peaking bench --json bench.json
  peaking bench live --json live.json
  peaking bench view --json view.json
  peaking bench generators
  peaking bench trust scenes/desk
  peaking bench guidance scenes/desk

`peaking COMMAND --help` explains one command; `peaking --version` prints the version."""


@runtime_checkable
class Command(Protocol):
    """A subcommand: its fields are the arguments."""

    def run(self) -> None:
        """Run the command."""
        ...


COMMANDS: dict[str, type[Command]] = {
    "demo": demo.Demo,
    "serve": serve.Serve,
    "devices": devices.ListDevices,
    "study": study.Study,
    "replay": replay.Replay,
    "select": select.Select,
    "convert": convert.Convert,
    "plan": plan.Plan,
    "generate": generate.Generate,
    "info": info.Info,
    "doctor": doctor.Doctor,
    "render": render.Render,
    "splat": splat.Splat,
    "view": view.View,
    "share": share.Share,
    "evaluate": evaluate.Evaluate,
    "photographers": photographers.Photographers,
    "quality": quality.Quality,
    "checkpoints": checkpoints.Checkpoints,
    "bench": bench.Bench,
    "bench live": bench_live.BenchLive,
    "bench doctor": bench_doctor.BenchDoctor,
    "bench guidance": bench_guidance.BenchGuidance,
    "bench generators": bench_generators.BenchGenerators,
    "bench trust": bench_trust.BenchTrust,
    "bench view": bench_view.BenchView,
}


def _subcommands(*, whole: bool) -> Any:
    """Return the union of all subcommands, described by a line or by the whole docstring."""
    described: list[Any] = []
    for name, command in COMMANDS.items():
        text = inspect.getdoc(command) or ""
        description = text if whole else text.partition("\n")[0]
        subcommand = tyro.conf.subcommand(name, description=description)
        described.append(Annotated[with_plain_help(command), subcommand])
    return functools.reduce(lambda a, b: a | b, described)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; exit code 2 for bad input, 130 for Ctrl-C."""
    # Idle threads of a kernel sleep: by default they spin for some 10 ms and slow down whatever
    # runs next or beside them. This has to be set before the first kernel runs.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    sys.excepthook = show_fault
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words[:1] == ["--version"]:
        say(f"peaking {peaking.__version__}")
        return
    if " ".join(words[:2]) in COMMANDS and words[:1] == ["bench"]:
        words[:2] = [f"bench {words[1]}"]  # these names have two words
    command: Command = tyro.cli(
        _subcommands(whole=words[:1] not in ([], ["-h"], ["--help"])),
        prog="peaking",
        description=DESCRIPTION,
        args=words,
        config=(tyro.conf.OmitArgPrefixes,),
    )
    try:
        command.run()
    except PeakingError as error:
        say(f"peaking: {error}", problem=True)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        say("peaking: interrupted; no half-written files are left", problem=True)
        raise SystemExit(130) from None
