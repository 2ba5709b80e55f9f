"""The `peaking` command: one subcommand per thing a person wants done."""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Sequence
from typing import Annotated, Any, Protocol, runtime_checkable

import tyro

from peaking.commands import (
    bench,
    bench_generators,
    bench_live,
    checkpoints,
    demo,
    evaluate,
    generate,
    plan,
    quality,
    render,
    replay,
    serve,
    splat,
    study,
)
from peaking.errors import PeakingError

DESCRIPTION = """See in red, while you photograph, which pixels view synthesis still gets wrong.

Examples:
  peaking demo
  peaking serve ~/captures
  peaking study init study
  peaking replay scenes/desk --out out/desk
  peaking replay scenes/desk --out out/paper --preset paper --overlay video
  peaking generate scenes/desk --frame 0 --out view.mpi
  peaking render view.mpi --move-m 0.1 0 0 --out moved.png
  peaking splat scenes/desk --out desk.ply
  peaking plan --zmin 0.5 --area 0.15
  peaking evaluate scenes/desk --out out/evaluation
  peaking quality scenes/desk
  peaking checkpoints
  peaking bench --json bench.json
  peaking bench live --json live.json
  peaking bench generators

`peaking COMMAND --help` tells about one command."""


@runtime_checkable
class Command(Protocol):
    """What every subcommand is: its fields are the arguments."""

    def run(self) -> None:
        """Do it."""
        ...


def _subcommand(name: str, command: type[Command]) -> Any:
    """Name a subcommand and show its whole docstring, examples included."""
    return tyro.conf.subcommand(name, description=inspect.getdoc(command))


Commands = (
    Annotated[demo.Demo, _subcommand("demo", demo.Demo)]
    | Annotated[serve.Serve, _subcommand("serve", serve.Serve)]
    | Annotated[study.Study, _subcommand("study", study.Study)]
    | Annotated[replay.Replay, _subcommand("replay", replay.Replay)]
    | Annotated[plan.Plan, _subcommand("plan", plan.Plan)]
    | Annotated[generate.Generate, _subcommand("generate", generate.Generate)]
    | Annotated[render.Render, _subcommand("render", render.Render)]
    | Annotated[splat.Splat, _subcommand("splat", splat.Splat)]
    | Annotated[evaluate.Evaluate, _subcommand("evaluate", evaluate.Evaluate)]
    | Annotated[quality.Quality, _subcommand("quality", quality.Quality)]
    | Annotated[checkpoints.Checkpoints, _subcommand("checkpoints", checkpoints.Checkpoints)]
    | Annotated[bench.Bench, _subcommand("bench", bench.Bench)]
    | Annotated[bench_live.BenchLive, _subcommand("bench-live", bench_live.BenchLive)]
    | Annotated[
        bench_generators.BenchGenerators,
        _subcommand("bench-generators", bench_generators.BenchGenerators),
    ]
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; exit code 2 for bad input, 130 for Ctrl-C."""
    # Idle threads of a kernel sleep: by default they spin for some 10 ms, and keep from work what
    # comes next or runs beside. It has to be said before the first kernel runs.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words[:1] == ["bench"] and words[1:2] in (["live"], ["generators"]):
        words[:2] = [f"bench-{words[1]}"]
    command: Command = tyro.cli(
        Commands,  # type: ignore[arg-type]
        prog="peaking",
        description=DESCRIPTION,
        args=words,
        config=(tyro.conf.OmitArgPrefixes,),
    )
    try:
        command.run()
    except PeakingError as error:
        print(f"peaking: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except ValueError as error:
        print(f"peaking: wrong argument: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        print("peaking: interrupted; nothing half-written is left", file=sys.stderr)
        raise SystemExit(130) from None
