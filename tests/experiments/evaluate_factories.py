"""Made-up results for the tests of intervals, tables and report; what the recorded walk is like."""

from collections.abc import Sequence

from peaking.experiments.results import Case, CaseResult, ViewScore

FRAMES = 24
SIZE_PX = (48, 64)
"""Of the fixture `walk`."""


def case(strategy: str = "peaking", seed: int = 0, n_views: int = 8, scene: str = "desk") -> Case:
    return Case(scene, strategy, "mpi", "holdout", n_views, seed)


def score(
    view: int,
    psnr: float,
    ssim: float = 0.9,
    *,
    lpips: float | None = None,
    picture: str | None = None,
) -> ViewScore:
    return ViewScore(
        view=view,
        psnr=psnr,
        ssim=ssim,
        flip=0.1,
        lpips=lpips,
        st_lpips=None,
        psnr_seen=psnr + 1,
        coverage=0.98,
        picture=picture,
    )


def result(of: Case, psnrs: Sequence[float], *, views: Sequence[int] | None = None) -> CaseResult:
    """Return a data set with these PSNRs of test views 0, 10, 20, …"""
    numbers = views if views is not None else range(0, 10 * len(psnrs), 10)
    scores = tuple(score(view, psnr) for view, psnr in zip(numbers, psnrs, strict=True))
    return CaseResult(case=of, views=tuple(range(of.n_views)), scores=scores, seconds=2.5)
