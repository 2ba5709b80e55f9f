"""Build the release as a user would get it, install it into an empty environment, and try it.

    .venv/bin/python scripts/check_release.py [--keep FOLDER]

Source distribution, then a wheel from the source distribution alone, then a virtual environment
with that wheel and what it depends on (at the locked versions), where no Node.js can be found.
There, `peaking demo` has to answer the capture page with all its files, and `peaking replay` has
to walk the sample scene, with the kernels that numba has compiled for this checkout. The web client
must have been built (`make client`).
"""

from __future__ import annotations

import argparse
import contextlib
import re
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.request
import venv
from collections.abc import Generator, Sequence
from pathlib import Path

ROOT = Path(__file__).parent.parent
STARTS_WITHIN_S = 600
FRAMES = 3


def main() -> None:
    """Build, install, try; what is wrong ends it with one sentence."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--keep", type=Path, help="leave both distributions in this folder")
    keep: Path | None = parser.parse_args().keep
    with tempfile.TemporaryDirectory(prefix="peaking-release-") as name:
        folder = Path(name)
        with timed("source distribution"):
            python(["-m", "hatchling", "build", "-t", "sdist", "-d", str(folder)], ROOT)
            (source,) = folder.glob("*.tar.gz")
        with timed("wheel from it"):
            wheel_of = ["-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
            python([*wheel_of, "--wheel-dir", str(folder), str(source)], folder)
            (wheel,) = folder.glob("*.whl")
        with timed("clean environment"):
            programs = environment_with(wheel, folder)
        lend_kernels(folder / "environment")
        with timed("peaking demo"):
            demo_answers(programs, folder)
        with timed("peaking replay"):
            replay_runs(programs, folder)
        if keep is not None:
            keep.mkdir(parents=True, exist_ok=True)
            for built in (source, wheel):
                print(f"kept {shutil.copy(built, keep)}")


@contextlib.contextmanager
def timed(what: str) -> Generator[None, None, None]:
    """Say what is done and how long it took; end with a sentence when it fails."""
    print(f"release: {what} ...", end="", flush=True)
    began_s = time.monotonic()
    try:
        yield
    except (subprocess.CalledProcessError, OSError, ValueError) as error:
        said = getattr(error, "stderr", None) or ""
        print()
        raise SystemExit(f"{said}release: {what} failed: {error}") from None
    print(f" {time.monotonic() - began_s:.0f} s")


def python(arguments: Sequence[str], folder: Path, *, program: str = sys.executable) -> None:
    """Run Python in a folder."""
    subprocess.run([program, *arguments], cwd=folder, check=True, stderr=subprocess.PIPE, text=True)


def environment_with(wheel: Path, folder: Path) -> Path:
    """Install a wheel into a new environment; return a folder with all programs that it may use."""
    environment = folder / "environment"
    venv.create(environment, with_pip=True)
    pinned = re.sub(r" *\\$|^ *--hash.*$", "", (ROOT / "requirements.lock").read_text(), flags=re.M)
    (folder / "constraints.txt").write_text(pinned)
    install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    python(
        [*install, "--constraint", str(folder / "constraints.txt"), str(wheel)],
        folder,
        program=str(environment / "bin" / "python"),
    )
    programs = environment / "bin"
    ffmpeg = shutil.which("ffmpeg")
    if ffmpeg is None:
        raise ValueError("ffmpeg is missing; run scripts/install_system_packages")
    (programs / "ffmpeg").symlink_to(ffmpeg)
    if shutil.which("node", path=str(programs)):
        raise ValueError("the environment is not clean: it has Node.js")
    return programs


def lend_kernels(environment: Path) -> None:
    """Give the installed package the machine code of this checkout: compiling it takes minutes.

    numba takes it for files of the same time and size, and compiles anew what is not the same.
    """
    (installed,) = environment.glob("lib/python*/site-packages/peaking")
    checkout = ROOT / "src" / "peaking"
    for code in checkout.rglob("__pycache__/*.nb[ic]"):
        folder = installed / code.parent.relative_to(checkout)
        folder.mkdir(exist_ok=True)
        shutil.copy2(code, folder)
        source = Path(code.parent.parent.relative_to(checkout), code.name.split(".")[0] + ".py")
        shutil.copystat(checkout / source, installed / source)


def demo_answers(programs: Path, folder: Path) -> None:
    """Start `peaking demo`, and fetch the page and every file that it names."""
    command = [str(programs / "peaking"), "demo", "--no-open", "--port", "0"]
    server = subprocess.Popen(
        command, cwd=folder, env=surroundings(programs, folder), stdout=subprocess.PIPE, text=True
    )
    try:
        assert server.stdout is not None
        said = server.stdout.readline()
        address = re.search(r"http://\S+?/", said)
        if address is None:
            raise ValueError(f"need the page's address in its first line, got {said!r}")
        page = fetched(address[0])
        names = re.findall(r'(?:src|href)="(?:\./|/)?(assets/[^"]+)"', page)
        if not any(name.endswith(".js") for name in names):
            raise ValueError(f"need a page with a script, got {page[:200]!r}")
        for name in names:
            fetched(address[0] + name)
    finally:
        server.terminate()
        server.wait(STARTS_WITHIN_S)


def fetched(address: str) -> str:
    """Return what an address answers; anything but success is an error."""
    with urllib.request.urlopen(address, timeout=STARTS_WITHIN_S) as answer:
        return answer.read().decode()


def replay_runs(programs: Path, folder: Path) -> None:
    """Replay the beginning of the sample scene, and look for all that it promises."""
    out = folder / "replay"
    command = [str(programs / "peaking"), "replay", str(ROOT / "scenes" / "desk")]
    subprocess.run(
        [*command, "--out", str(out), "--max-frames", str(FRAMES)],
        cwd=folder,
        env=surroundings(programs, folder),
        check=True,
        capture_output=True,
        text=True,
    )
    missing = {"overlay.mp4", "frames.csv", "summary.json", "report.html", "captured"}
    missing -= {path.name for path in out.iterdir()}
    if missing:
        raise ValueError(f"it wrote no {', '.join(sorted(missing))}")


def surroundings(programs: Path, home: Path) -> dict[str, str]:
    """Return an environment without anything of this one: no checkout, no Node.js."""
    return {"PATH": str(programs), "HOME": str(home), "LANG": "C.UTF-8", "PYTHONUNBUFFERED": "1"}


if __name__ == "__main__":
    main()
