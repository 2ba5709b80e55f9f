"""Rendering and optimising on CUDA, by gsplat (Ye et al. 2024; extra `splat`).

gsplat's wheel brings its CUDA sources; they are compiled at the first use, by nvcc, in minutes.
Its sums go in any order, so two trainings with the same seed differ a little. It has two cut-offs
of its own, those that are our defaults: alpha from 1/255 to 0.999, and a pixel is done at 1e-4.
"""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from jaxtyping import Float32

from peaking.errors import BackendUnavailable
from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.splat.gaussians import Gaussians
from peaking.splat.loss import (
    SSIM_C1,
    SSIM_C2,
    SSIM_SHARE,
    SSIM_SIGMA_PX,
    SSIM_WINDOW_PX,
)
from peaking.splat.optimiser import ADAM_BETAS, ADAM_EPSILON, GRADIENT_LIMIT, Moments
from peaking.splat.view import DILATION_PX2, CutOffs, View

INSTALL = "install an NVIDIA driver, nvcc and pip install 'peaking[splat]', or take --backend numba"


def check_available() -> None:
    """Compile gsplat if that is still to be done.

    Raises:
        BackendUnavailable: gsplat, torch, CUDA or nvcc is missing.
    """
    _Cuda(CutOffs())


def render(gaussians: Gaussians, camera: Camera, cut_offs: CutOffs) -> View:
    """Render; see `peaking.splat.rasterise.render`.

    Raises:
        BackendUnavailable: gsplat, torch, CUDA or nvcc is missing.
    """
    cuda = _Cuda(cut_offs)
    with cuda.torch.no_grad():
        parameters = cuda.tensor(gaussians.packed())
        picture, alpha, _ = cuda.rasterize(parameters, camera, mode="RGB+ED")
    seen = alpha > 1e-6
    rgb, depth_m = picture[..., :3], picture[..., 3] * seen
    return View(rgb.cpu().numpy(), alpha.cpu().numpy(), depth_m.cpu().numpy())


class GsplatOptimiser:
    """See `peaking.splat.optimiser.Optimiser`."""

    def __init__(self, moments: Moments, cut_offs: CutOffs) -> None:
        self._cuda = _Cuda(cut_offs)
        self._window = self._cuda.ssim_window()
        self._steps = 0
        self.restart(moments)

    def restart(self, moments: Moments) -> None:
        """Go on with other Gaussians."""
        tensor = self._cuda.tensor
        self._parameters = tensor(moments.parameters).requires_grad_()
        self._first, self._second = tensor(moments.first), tensor(moments.second)
        self._screen = self._cuda.torch.zeros((2, len(moments.parameters)), device="cuda")

    def step(self, frame: Frame, rates: Float32[np.ndarray, "columns"]) -> float:
        """Render, compare, move."""
        picture, _, meta = self._cuda.rasterize(self._parameters, frame.camera, mode="RGB")
        meta["means2d"].retain_grad()
        loss = self._loss(picture, self._cuda.tensor(frame.rgb).float() / 255)
        self._parameters.grad = None
        loss.backward()
        with self._cuda.torch.no_grad():
            self._note_pulls(meta, frame.camera)
            self._move(self._cuda.tensor(rates))
        return float(loss.detach())

    def moments(self) -> Moments:
        """Return the parameters as they are now."""
        kept = (self._parameters.detach(), self._first, self._second)
        parameters, first, second = (values.cpu().numpy() for values in kept)
        return Moments(parameters, first, second)

    def pulls(self) -> Float32[np.ndarray, "n"]:
        """Return the mean gradient by the position on the picture."""
        return (self._screen[0] / self._screen[1].clamp(min=1)).cpu().numpy()

    def _loss(self, picture: Any, photo: Any) -> Any:
        """Return what `peaking.splat.loss.loss_and_gradient` returns first."""
        x, y = picture.permute(2, 0, 1), photo.permute(2, 0, 1)
        stacked = self._cuda.torch.cat([x, y, x * x + y * y, x * y])[:, None]
        convolved = self._cuda.torch.nn.functional.conv2d(
            stacked, self._window, padding=SSIM_WINDOW_PX // 2
        )
        mean_x, mean_y, squares, product = convolved.view(4, 3, *x.shape[1:])
        similarity = (2 * mean_x * mean_y + SSIM_C1) * (2 * (product - mean_x * mean_y) + SSIM_C2)
        both = mean_x * mean_x + mean_y * mean_y
        similarity = similarity / ((both + SSIM_C1) * (squares - both + SSIM_C2))
        l1 = (picture - photo).abs().mean()
        return (1 - SSIM_SHARE) * l1 + SSIM_SHARE * (1 - similarity.mean())

    def _note_pulls(self, meta: Any, camera: Camera) -> None:
        half = self._cuda.torch.tensor(camera.pinhole.size_px, device="cuda") / 2
        seen = (meta["radii"][0] > 0).all(dim=-1)
        self._screen[0] += (meta["means2d"].grad[0] * half).norm(dim=-1) * seen
        self._screen[1] += seen

    def _move(self, rates: Any) -> None:
        """Take a step of Adam (Kingma and Ba 2015)."""
        self._steps += 1
        gradient = self._parameters.grad
        gradient = gradient.where(gradient.abs() < GRADIENT_LIMIT, 0)
        b1, b2 = ADAM_BETAS
        self._first.lerp_(gradient, 1 - b1)
        self._second.lerp_(gradient * gradient, 1 - b2)
        first = self._first / (1 - b1**self._steps)
        second = self._second / (1 - b2**self._steps)
        self._parameters -= rates * first / (second.sqrt() + ADAM_EPSILON)


class _Cuda:
    """torch and gsplat, imported when they are asked for."""

    def __init__(self, cut_offs: CutOffs) -> None:
        self.torch = _imported("torch")
        if not self.torch.cuda.is_available():
            raise BackendUnavailable(f"torch finds no CUDA device: {INSTALL}")
        self._rasterization = _imported("gsplat").rasterization
        if _imported("gsplat.cuda._backend")._C is None:
            raise BackendUnavailable(f"gsplat could not be compiled: {INSTALL}")
        self._near_m = cut_offs.near_m

    def tensor(self, values: np.ndarray) -> Any:
        """Copy to the device."""
        return self.torch.tensor(values, device="cuda")

    def rasterize(self, parameters: Any, camera: Camera, *, mode: str) -> tuple[Any, Any, Any]:
        """Return the picture, its opacity and gsplat's notes."""
        num_sh = (parameters.shape[1] - 11) // 3
        pinhole = camera.pinhole
        cam_from_world = camera.world_from_cam.inverse().matrix().astype(np.float32)
        pictures, alphas, meta = self._rasterization(
            means=parameters[:, :3],
            quats=parameters[:, 6:10],
            scales=parameters[:, 3:6].exp(),
            opacities=parameters[:, 10].sigmoid(),
            colors=parameters[:, 11:].reshape(-1, num_sh, 3),
            viewmats=self.tensor(cam_from_world)[None],
            Ks=self.tensor(pinhole.px_from_cam.astype(np.float32))[None],
            width=pinhole.width_px,
            height=pinhole.height_px,
            near_plane=self._near_m,
            eps2d=DILATION_PX2,
            sh_degree=0 if num_sh == 1 else 1,
            packed=False,
            render_mode=mode,
        )
        return pictures[0], alphas[0, ..., 0], meta

    def ssim_window(self) -> Any:
        """Return the Gaussian window of SSIM, 1×1×11×11."""
        away_px = self.torch.arange(SSIM_WINDOW_PX, device="cuda") - SSIM_WINDOW_PX // 2
        row = (-0.5 * (away_px / SSIM_SIGMA_PX) ** 2).exp()
        row = row / row.sum()
        return (row[:, None] * row[None, :])[None, None]


def _imported(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except (ImportError, OSError, RuntimeError) as error:
        raise BackendUnavailable(f"{name} cannot be used ({error}): {INSTALL}") from error
