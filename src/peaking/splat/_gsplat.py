"""Rendering and optimising on CUDA, by gsplat (Ye et al. 2024; extra `splat`).

gsplat's wheel contains CUDA sources; nvcc compiles them at the first use, which takes minutes.
Its sums go in any order, so two trainings with the same seed differ a little. Of the cut-offs it
takes `near_m` only; the others are fixed in it, at our defaults.
"""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from jaxtyping import Float32

from peaking.errors import BackendUnavailable
from peaking.frame import Frame
from peaking.geometry import Camera
from peaking.splat.columns import LOG_SCALES, MEANS, OPACITY_LOGIT, QUATS, SH
from peaking.splat.gaussians import Gaussians
from peaking.splat.loss import (
    SSIM_C1,
    SSIM_C2,
    SSIM_LAMBDA,
    SSIM_SIGMA_PX,
    SSIM_WINDOW_PX,
)
from peaking.splat.optimiser import (
    ADAM_BETAS,
    ADAM_EPSILON,
    MAX_GRADIENT,
    AdamState,
    Progress,
)
from peaking.splat.rendering import DILATION_PX2, CutOffs, Rendering

INSTALL = "install an NVIDIA driver, nvcc and pip install 'peaking[splat]', or use --backend numba"


def check_available() -> None:
    """Compile gsplat if it is not compiled yet.

    Raises:
        BackendUnavailable: gsplat, torch, CUDA or nvcc is missing.
    """
    _Cuda(CutOffs())


def render(gaussians: Gaussians, camera: Camera, cut_offs: CutOffs) -> Rendering:
    """Render; see `peaking.splat.rasterise.render`.

    Raises:
        BackendUnavailable: gsplat, torch, CUDA or nvcc is missing.
    """
    cuda = _Cuda(cut_offs)
    with cuda.torch.no_grad():
        parameters = cuda.tensor(gaussians.parameters())
        image, alpha, _ = cuda.rasterize(parameters, camera, mode="RGB+ED")
    rgb, depth_m = image[..., :3], image[..., 3] * (alpha > 1e-6)
    return Rendering(rgb.cpu().numpy(), alpha.cpu().numpy(), depth_m.cpu().numpy())


class GsplatOptimiser:
    """See `peaking.splat.optimiser.Optimiser`."""

    def __init__(self, state: AdamState, cut_offs: CutOffs) -> None:
        self._cuda = _Cuda(cut_offs)
        self._window = self._cuda.ssim_window()
        self._steps = 0
        self.reset(state)

    def reset(self, state: AdamState) -> None:
        """Go on with other Gaussians."""
        tensor = self._cuda.tensor
        self._parameters = tensor(state.parameters).requires_grad_()
        self._first_moment = tensor(state.first_moment)
        self._second_moment = tensor(state.second_moment)
        self._grad2d = self._cuda.torch.zeros(len(state.parameters), device="cuda")
        self._count = self._cuda.torch.zeros(len(state.parameters), device="cuda")

    def step(self, frame: Frame, learning_rates: Float32[np.ndarray, "columns"]) -> float:
        """Render, compare, move."""
        image, _, meta = self._cuda.rasterize(self._parameters, frame.camera, mode="RGB")
        meta["means2d"].retain_grad()
        photo = self._cuda.tensor(frame.rgb).float() / 255
        if frame.mask is not None:  # what does not count is as it should be
            mask = self._cuda.tensor(frame.mask)[..., None]
            image = image.where(mask, image.detach())
            photo = photo.where(mask, image.detach())
        loss = self._loss(image, photo)
        self._parameters.grad = None
        loss.backward()
        with self._cuda.torch.no_grad():
            self._accumulate_grad2d(meta, frame.camera)
            self._move(self._cuda.tensor(learning_rates))
        return float(loss.detach())

    def state(self) -> AdamState:
        """Return the parameters and moments as they are now."""
        return AdamState(
            self._parameters.detach().cpu().numpy(),
            self._first_moment.cpu().numpy(),
            self._second_moment.cpu().numpy(),
        )

    def mean_grad2d(self) -> Float32[np.ndarray, "n"]:
        """Return the mean length of the gradient by the projected centre."""
        return (self._grad2d / self._count.clamp(min=1)).cpu().numpy()

    def progress(self) -> Progress:
        """Return what else is needed to go on later."""
        return Progress(self._steps, self._grad2d.cpu().numpy(), self._count.cpu().numpy())

    def go_on(self, state: AdamState, progress: Progress) -> None:
        """Go on from where another optimiser stopped."""
        self.reset(state)
        self._steps = progress.steps
        self._grad2d = self._cuda.tensor(progress.grad2d)
        self._count = self._cuda.tensor(progress.count)

    def _loss(self, image: Any, photo: Any) -> Any:
        """Return what `peaking.splat.loss.loss_and_gradient` returns first."""
        x, y = image.permute(2, 0, 1), photo.permute(2, 0, 1)
        stacked = self._cuda.torch.cat([x, y, x * x + y * y, x * y])[:, None]
        convolved = self._cuda.torch.nn.functional.conv2d(
            stacked, self._window, padding=SSIM_WINDOW_PX // 2
        )
        mean_x, mean_y, squares, product = convolved.view(4, 3, *x.shape[1:])
        similarity = (2 * mean_x * mean_y + SSIM_C1) * (2 * (product - mean_x * mean_y) + SSIM_C2)
        both = mean_x * mean_x + mean_y * mean_y
        similarity = similarity / ((both + SSIM_C1) * (squares - both + SSIM_C2))
        l1 = (image - photo).abs().mean()
        return (1 - SSIM_LAMBDA) * l1 + SSIM_LAMBDA * (1 - similarity.mean())

    def _accumulate_grad2d(self, meta: Any, camera: Camera) -> None:
        half = self._cuda.torch.tensor(camera.pinhole.size_px, device="cuda") / 2
        seen = (meta["radii"][0] > 0).all(dim=-1)
        self._grad2d += (meta["means2d"].grad[0] * half).norm(dim=-1) * seen
        self._count += seen

    def _move(self, learning_rates: Any) -> None:
        """Take a step of Adam (Kingma and Ba 2015)."""
        self._steps += 1
        gradient = self._parameters.grad
        gradient = gradient.where(gradient.abs() < MAX_GRADIENT, 0)
        b1, b2 = ADAM_BETAS
        self._first_moment.lerp_(gradient, 1 - b1)
        self._second_moment.lerp_(gradient * gradient, 1 - b2)
        first = self._first_moment / (1 - b1**self._steps)
        second = self._second_moment / (1 - b2**self._steps)
        self._parameters -= learning_rates * first / (second.sqrt() + ADAM_EPSILON)


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
        """Return the image, its opacity and gsplat's `meta`."""
        sh = parameters[:, SH]
        num_sh = sh.shape[1] // 3
        pinhole = camera.pinhole
        cam_from_world = camera.world_from_cam.inverse().matrix().astype(np.float32)
        images, alphas, meta = self._rasterization(
            means=parameters[:, MEANS],
            quats=parameters[:, QUATS],
            scales=parameters[:, LOG_SCALES].exp(),
            opacities=parameters[:, OPACITY_LOGIT].sigmoid(),
            colors=sh.reshape(-1, num_sh, 3),
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
        return images[0], alphas[0, ..., 0], meta

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
