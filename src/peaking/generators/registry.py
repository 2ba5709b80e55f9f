"""The generators by name."""

from __future__ import annotations

from peaking.checkpoints import adampi_file
from peaking.errors import BackendUnavailable
from peaking.generators import Generator
from peaking.generators.layered import Layered
from peaking.options import Options


def create_generator(options: Options) -> Generator:
    """Return the generator that the options name, ready for use.

    Raises:
        BackendUnavailable: It needs PyTorch, or CUDA, which is not there.
        CheckpointError: Its checkpoint is missing or cannot be used.
    """
    if options.generator == "layered":
        return Layered(num_planes=options.num_planes)
    try:
        from peaking.generators.adampi.generator import AdaMpi
    except ImportError as error:
        raise BackendUnavailable(
            f"the generator `{options.generator}` needs PyTorch ({error}); "
            "pip install 'peaking[torch]'"
        ) from error
    return AdaMpi.load(
        options.checkpoint or adampi_file(options.num_planes),
        num_planes=options.num_planes,
        device=options.device,
        precision=options.precision,
    )
