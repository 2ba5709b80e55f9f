"""One photographer with one guide: what they take within their limits."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from peaking.frame import Frame
from peaking.geometry import Cam, Rigid, World
from peaking.options import PAPER_PEAKED_SHARE
from peaking.photographers.auto_shutter import WORTH_SHARE, AutoMoment, AutoShutter, Motion
from peaking.photographers.body import MOST_OFF, Body
from peaking.photographers.ghost import Ghost
from peaking.photographers.grid_walk import walk_the_grid
from peaking.photographers.guides import AUTOMATIC, GUIDES, GuideName
from peaking.photographers.screen import Screen, Shown
from peaking.photographers.sensor import Shot, take_frame, told_camera
from peaking.photographers.tasks import TASKS, SceneName, open_scene
from peaking.photographers.temperaments import TEMPERAMENTS, Temperament
from peaking.photographers.walks import draw_walk
from peaking.pipeline import Reconstruction

STEP_S = 0.25
"""So often the shutter may go."""

LOOK_STEPS = 2
"""So many steps from one look at the screen to the next."""

READY_S = 0.5
"""After a press, until the view takes part in what is shown."""

FIRST_S = 0.5
"""When the first photo is taken, by hand."""

BORED_S, FORGETS_S, BLIND_S = 5.0, 3.0, 2.0
"""Who has stood before red for so long goes on; for so long; so long they miss what they miss."""

TURN_S, LEAST_TURN_RAD = 1.5, 0.12
"""In which they turn to where red is, if they follow, and what they do not turn for."""

SLOWS, SLOWS_FOR_AUTO = 0.85, 0.4
"""How much of their speed much red takes from those who follow it: of who has to press, and of who
has an automatic shutter, which asks for it when it is needed."""

MUCH_SHARE = 0.1
"""What is much; less red slows less."""

MOST_LED = 1.5
"""How far off their walk a frame to step into may lead, in coordinates."""

HOLD_S = 0.75
"""So long they hold still to press, or when the automatic shutter asks for it."""

LEVEL_SPREAD = 0.35
"""By hand, how much is much differs from one to another: deviation of its logarithm."""

SEED = 19_810


@dataclass(frozen=True)
class Limits:
    """What a photographer may use up: photos, None where all that is taken counts; and seconds."""

    photos: int | None
    seconds: float


@dataclass(frozen=True)
class Taken:
    """What a photographer brought home.

    Attributes:
        shots: The photos in their order.
        path: Position and viewing direction at every look, x y z and dx dy dz.
    """

    shots: tuple[Shot, ...]
    path: tuple[tuple[float, ...], ...]


def seed_of(scene: SceneName, photographer: int) -> tuple[int, ...]:
    """Return what all chance of a photographer in a scene comes from, whatever the guide."""
    return SEED, sorted(TASKS).index(scene), photographer


def temperament_of(photographer: int) -> Temperament:
    """Return how a photographer is: of every three, one is of each temperament."""
    return list(TEMPERAMENTS.values())[photographer % len(TEMPERAMENTS)]


def photograph(scene: SceneName, guide: GuideName, photographer: int, limits: Limits) -> Taken:
    """Let a photographer work.

    Args:
        scene: Where.
        guide: What the screen shows, and who presses.
        photographer: Their number, from 0; walks are the same with every guide.
        limits: When they stop.
    """
    task, seed = TASKS[scene], seed_of(scene, photographer)
    temperament = temperament_of(photographer)
    if guide == "llff":
        return Taken(*walk_the_grid(task, temperament, limits.photos or 1, limits.seconds, seed))
    walk = draw_walk(
        task,
        np.random.default_rng((*seed, 1)),
        seconds=1.4 * limits.seconds,
        speed_m_per_s=temperament.speed_m_per_s,
    )
    session = _Session(scene, guide, Body(task, temperament, walk, seed), temperament, seed)
    return session.interval(limits) if guide == "interval" else session.guided(limits)


class _Session:
    def __init__(
        self,
        scene: SceneName,
        guide: GuideName,
        body: Body,
        temperament: Temperament,
        seed: Sequence[int],
    ) -> None:
        self._scene, self._body = open_scene(scene), body
        self._guide: GuideName = guide
        self._temperament, self._seed = temperament, seed
        self._rng = np.random.default_rng((*seed, 2))
        self._mood = np.exp(LEVEL_SPREAD * self._rng.standard_normal())
        self._depth_m = 1.5
        self._path: list[tuple[float, ...]] = []
        self._shots: list[Shot] = []

    def interval(self, limits: Limits) -> Taken:
        """Walk, and let the shutter go evenly in time."""
        count = limits.photos or 1
        times_s = (np.arange(count) + 0.5) * limits.seconds / count
        steps = round(limits.seconds / STEP_S)
        due = {min(steps - 1, round(float(t) / STEP_S)) for t in times_s}
        for step in range(steps):
            self._note(step * STEP_S)
            if step in due:
                depth_m = self._scene.depth_m(self._body.camera(step * STEP_S).resized(45, 80))
                self._shots.append(self._body.shot(step, step * STEP_S, float(np.median(depth_m))))
            self._body.go_on(STEP_S)
        return Taken(tuple(self._shots), tuple(self._path))

    def guided(self, limits: Limits) -> Taken:
        """Walk, heed the screen, and press, or let the automatic shutter."""
        options = GUIDES[self._guide].screen
        assert options is not None
        views = Reconstruction(options)
        screen = Screen(views, WORTH_SHARE)
        ghost = Ghost(options) if self._guide == "next" else None
        self._body.most_off = MOST_OFF if ghost is None else MOST_LED
        slows = SLOWS_FOR_AUTO if self._guide in AUTOMATIC else SLOWS
        heed = _Heed(self._body, self._temperament, self._rng, slows)
        motion, auto = Motion(), AutoShutter()
        arriving: deque[tuple[float, Frame]] = deque()
        taken_s = -np.inf
        shown: Shown | None = None
        for step in range(round(limits.seconds / STEP_S)):
            time_s = step * STEP_S
            self._note(time_s)
            while arriving and arriving[0][0] <= time_s:
                frame = arriving.popleft()[1]
                views.add_view(frame)
                if ghost is not None:
                    ghost.add_view(frame)
            shot = self._body.shot(step, time_s, self._depth_m)
            told = told_camera(shot, self._seed)
            motion.update(1e3 * time_s, told)
            if ghost is not None:
                ghost.walk(time_s, told)
            if views.views and step % LOOK_STEPS == 0:
                shown = screen.show(self._frame(shot))
            perceived = heed.look(time_s, shown, None if ghost is None else ghost.place)
            if self._guide in AUTOMATIC and self._shots:
                moment = AutoMoment(
                    1e3 * time_s,
                    not motion.too_fast,
                    motion.steady,
                    len(self._shots),
                    len(views.views),
                    None if shown is None else shown.peaked_share,
                )
                presses = auto.look(moment)
                if auto.asks_to_hold_still:
                    heed.hold_still(time_s)
            else:
                rested = time_s - taken_s >= self._temperament.pause_s and not motion.too_fast
                wants = rested and self._wants_to_press(time_s, perceived, limits)
                presses = wants and (heed.holds_still or not self._shots)
                if wants:
                    heed.hold_still(time_s)
            if presses:
                shot = self._body.shot(step, time_s, self._depth_m)  # as they hold it by now
                self._shots.append(shot)
                arriving.append((time_s + READY_S, self._frame(shot)))
                taken_s = time_s
                if limits.photos is not None and len(self._shots) == limits.photos:
                    break
            self._body.go_on(STEP_S)
        return Taken(tuple(self._shots), tuple(self._path))

    def _frame(self, shot: Shot) -> Frame:
        frame = take_frame(self._scene, shot, self._seed)
        if frame.depth_m is not None and (frame.depth_m > 0).any():
            self._depth_m = float(np.median(frame.depth_m[frame.depth_m > 0]))
        return frame

    def _wants_to_press(self, time_s: float, perceived: Shown | None, limits: Limits) -> bool:
        if not self._shots:
            return time_s >= FIRST_S
        if self._rng.random() < self._temperament.slips_per_s * STEP_S:
            return True
        if perceived is None:
            return False
        if self._guide == "threshold":
            return bool(perceived.peaked_share > PAPER_PEAKED_SHARE)
        return bool(perceived.peaked_share > self._level(time_s, limits))

    def _level(self, time_s: float, limits: Limits) -> float:
        """Return how much red is worth one of the photos that are left, for who has no rule.

        Who has used up more of the photos than of the time becomes choosy.
        """
        level = PAPER_PEAKED_SHARE * self._mood
        if limits.photos is not None:
            used = len(self._shots) / limits.photos
            level *= np.clip(used / max(time_s / limits.seconds, 0.02), 0.4, 4.0)
        return float(level)

    def _note(self, time_s: float) -> None:
        camera = self._body.camera(time_s)
        self._path.append((*camera.position_m.tolist(), *camera.forward.tolist()))


class _Heed:
    """Reacts to the screen, late and not always."""

    def __init__(
        self, body: Body, temperament: Temperament, rng: np.random.Generator, slows: float
    ) -> None:
        self._body, self._temperament, self._rng, self._slows = body, temperament, rng, slows
        self._shown: deque[tuple[float, Shown]] = deque()
        self._stood_s = 0.0
        self._going_until_s = self._blind_until_s = -np.inf
        self._hold_until_s = -np.inf
        self._was_red = self.holds_still = False

    def hold_still(self, time_s: float) -> None:
        """Stand and do not turn for a moment; who does not follow much may not hear of it."""
        hears = 0.4 + 0.6 * self._temperament.follows
        if time_s >= self._hold_until_s and self._rng.random() < hears:
            self._hold_until_s = time_s + HOLD_S

    def look(
        self, time_s: float, shown: Shown | None, place: Rigid[World, Cam] | None = None
    ) -> Shown | None:
        """Take in the screen, move accordingly; return what is known of it by now."""
        if shown is not None:
            self._shown.append((time_s, shown))
        while len(self._shown) > 1 and self._shown[1][0] <= time_s - self._temperament.reaction_s:
            self._shown.popleft()
        known = None
        if self._shown and self._shown[0][0] <= time_s - self._temperament.reaction_s:
            known = self._shown[0][1]
        is_red = known is not None and known.peaked_share >= WORTH_SHARE
        if is_red and not self._was_red and self._rng.random() < self._temperament.misses:
            self._blind_until_s = time_s + BLIND_S
        self._was_red = is_red
        if time_s < self._blind_until_s:
            known = None
        self._move(time_s, known, place)
        return known

    def _move(self, time_s: float, known: Shown | None, place: Rigid[World, Cam] | None) -> None:
        follows = self._temperament.follows
        self.holds_still = time_s < self._hold_until_s
        if self.holds_still:
            self._body.rate *= 0.3
            self._body.turning_per_s = np.zeros(5)
            return
        heeds = known is not None and time_s >= self._going_until_s
        is_red = known is not None and known.peaked_share >= WORTH_SHARE
        if place is not None and known is not None and known.peaked_share < MUCH_SHARE:
            # They step into the frame instead of going their own way.
            self._body.rate += 0.5 * (1 - follows - self._body.rate)
            self._body.go_to(place, follows=follows, least_s=TURN_S)
            return
        wanted = 1.0
        if heeds:
            much = min(1.0, known.peaked_share / MUCH_SHARE) if known is not None else 0.0
            wanted = 1 - self._slows * follows * much if is_red else 1 + 0.3 * follows
        self._body.rate += 0.5 * (wanted - self._body.rate)
        self._stood_s = self._stood_s + STEP_S if heeds and is_red else 0.0
        if self._stood_s > BORED_S:
            self._stood_s, self._going_until_s = 0.0, time_s + FORGETS_S
        if heeds and known is not None and known.towards_rad is not None:
            right_rad, up_rad = known.towards_rad
            far = np.hypot(right_rad, up_rad) > LEAST_TURN_RAD
            turn = follows if far else 0.0
            self._body.turn_towards(-turn * right_rad, turn * up_rad, within_s=TURN_S)
        elif self._body.most_off > MOST_OFF:
            self._body.stay_off()
        else:
            self._body.look_where_one_goes()
