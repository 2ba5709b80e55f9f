"""`import peaking`: the names, where they come from, and what they are called with."""

from __future__ import annotations

import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import peaking
from peaking.options import DEFAULT
from recordings import write_recording

NAMES = sorted(peaking.__all__)


@pytest.mark.parametrize("name", NAMES)
def test_a_name_of_the_library_is_documented(name: str) -> None:
    thing = getattr(peaking, name)
    if name != "PRESETS":
        assert inspect.getdoc(thing)
        assert thing.__module__.startswith("peaking.")


def test_no_module_has_the_name_of_a_function_of_the_library() -> None:
    """`peaking.render` is a function, whatever was imported before."""
    modules = {path.stem for path in Path(peaking.__file__).parent.iterdir()}
    assert modules & set(NAMES) == set()


def test_what_the_type_checker_sees_is_what_is_there() -> None:
    source = Path(peaking.__file__).read_text()
    checked = source[source.index("if TYPE_CHECKING:") : source.index("__version__")]
    for name in NAMES:
        home = next(
            line.split()[1]
            for line in checked.splitlines()
            if line.strip().startswith("from") and name in line.replace(",", " ").split()[3:]
        )
        assert getattr(importlib.import_module(home), name) is getattr(peaking, name)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'reconstruct'"):
        _ = peaking.reconstruct  # pyright: ignore


def test_importing_it_imports_nothing_heavy() -> None:
    code = "import sys, peaking; print([m for m in ('numba', 'cv2', 'numpy') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_defaults_of_functions_are_those_of_the_default_preset() -> None:
    parameters = inspect.signature(peaking.compare).parameters
    assert parameters["threshold"].default == DEFAULT.error_threshold
    assert parameters["shift_px"].default == DEFAULT.shift_px
    assert parameters["compensate_exposure"].default == DEFAULT.compensate_exposure
    for module, name, option in (
        ("rendering.blending", "blend", "opacity"),
        ("light_field", "render_views", "opacity"),
        ("scale_alignment", "align_scale", "align"),
        ("view_weights", "nearest_by_overlap", "neighbours"),
        ("view_weights", "nearest_by_distance", "neighbours"),
    ):
        function = getattr(importlib.import_module(f"peaking.{module}"), name)
        called = {"align": "method", "neighbours": "count"}.get(option, option)
        assert inspect.signature(function).parameters[called].default == getattr(DEFAULT, option)


def test_a_recording_goes_through_the_library(tmp_path: Path) -> None:
    """Every step that README's example and the docs speak of, on a drawn room."""
    recording = peaking.open_recording(str(write_recording(tmp_path / "room", num_frames=6)))
    chosen = peaking.select(recording, 2)
    assert len(chosen) == 2
    mpis = [peaking.generate(recording.read(i)) for i in chosen]
    for k, mpi in enumerate(mpis):
        peaking.write_mpi(tmp_path / f"{k}.mpi", mpi, codec="lossless")
    kept = [peaking.read_mpi(tmp_path / f"{k}.mpi") for k in range(2)]
    camera = mpis[0].camera
    rendered, again = (peaking.LightField(those).render(camera) for those in (mpis, kept))
    np.testing.assert_allclose(again.rgba, rendered.rgba, atol=1e-6)
    assert isinstance(rendered, peaking.Rendering)
    assert isinstance(recording, peaking.Recording)
