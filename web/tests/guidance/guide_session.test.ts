import { describe, expect, test } from 'vitest';
import { rigid, type Camera } from '../../src/geometry';
import { GuideSession, type GuideMemory } from '../../src/guidance/guide_session';
import { guideOptionsOf, type GuideOptions } from '../../src/guidance/guide_options';
import type { DepthMap } from '../../src/sources/frame_source';
import { steps } from '../../src/ui/guide_panel';

/** f = 50 px, five planes, 1 m: Δu = 0.1 m. */
const PINHOLE = { width_px: 100, height_px: 100, fx_px: 50, fy_px: 50, cx_px: 50, cy_px: 50 };
const MPI = { pixels: 100 * 100, num_planes: 5 };
const WALL: DepthMap = {
  width_px: 10, height_px: 10, depth_mm: new Uint16Array(100).fill(1000),
};

function at(x_m: number, y_m = 0): Camera {
  return { pinhole: PINHOLE, worldFromCam: rigid([1, 0, 0, x_m, 0, 1, 0, y_m, 0, 0, 1, 0]) };
}

function options(query = ''): GuideOptions {
  const found = guideOptionsOf(new URLSearchParams(`guide=plenoptic&area=0.2${query}`));
  if (found === null) throw new Error('no guide');
  return found;
}

class Memory implements GuideMemory {
  text: string | null = null;
  load(): string | null { return this.text; }
  save(text: string | null): void { this.text = text; }
}

const SEES_WALL = { depth: () => WALL };
const SEES_NOTHING = { depth: () => null };
const NONE: readonly { readonly camera: Camera }[] = [];

/** Look around for so many frames, a centimetre further in each. */
function scan(session: GuideSession, frames: number, depth = WALL): void {
  for (let i = 0; i < frames; i += 1) session.update(33 * i, at(0.01 * i), { depth: () => depth }, NONE);
}

describe('the scan', () => {
  test('places four targets around the camera once the depth is known', () => {
    const session = new GuideSession(options(), MPI, new Memory());
    scan(session, 4);
    expect(session.state.zMin_m).toBeNull();
    expect(session.place(at(0))).toMatch(/Look around/);
    scan(session, 12);
    expect(session.state.zMin_m).toBe(1);
    expect(session.state.bound?.viewsPerSide).toBe(2);
    expect(session.place(null)).toMatch(/Tracking/);
    expect(session.place(at(0))).toBeNull();
    const state = session.update(0, at(-0.05, -0.05), SEES_WALL, NONE);
    expect([state.phase, state.takenBy.length, state.next, state.reach])
      .toEqual(['capture', 4, 0, 0]);
  });

  test('a camera that stands still confirms nothing', () => {
    const session = new GuideSession(options(), MPI, new Memory());
    for (let i = 0; i < 100; i += 1) session.update(i, at(0), SEES_WALL, NONE);
    expect(session.state.scanned).toBe(1);
  });

  test('too many targets are refused, and the scan goes on', () => {
    const session = new GuideSession(options(), MPI, new Memory());
    scan(session, 20, { ...WALL, depth_mm: new Uint16Array(100).fill(50) });
    expect(session.place(at(0))).toMatch(/smaller area/);
    expect(session.update(0, at(0), SEES_WALL, NONE).phase).toBe('scan');
  });
});

describe('the capture', () => {
  function placed(query = '', memory = new Memory()): GuideSession {
    const session = new GuideSession(options(query), MPI, memory);
    scan(session, 12);
    session.place(at(0));
    return session;
  }

  test('views near targets take them; an undo opens them again', () => {
    const session = placed();
    const all = [[-1, -1], [1, -1], [-1, 1], [1, 1]].map(([x, y]) =>
      ({ camera: at(0.05 * (x ?? 0), 0.05 * (y ?? 0)) }));
    expect(session.update(0, at(0), SEES_NOTHING, all.slice(0, 1)).taken).toBe(1);
    expect(session.update(1, at(0), SEES_NOTHING, all).phase).toBe('done');
    expect(session.update(2, at(0), SEES_NOTHING, all.slice(1)).takenBy[0]).toBeNull();
  });

  test('the automatic shutter waits for a steady hand, and forgets when it leaves', () => {
    const session = placed('&shutter=auto');
    session.update(1000, at(0.05, 0.05), SEES_NOTHING, NONE);
    expect(session.held(1100)).toBe(false);
    expect(session.held(1400)).toBe(true);
    session.update(1500, at(0), SEES_NOTHING, NONE);
    expect(session.held(2000)).toBe(false);
    session.autoShutter = false;
    session.update(3000, at(0.05, 0.05), SEES_NOTHING, NONE);
    expect(session.held(5000)).toBe(false);
  });

  test('lost tracking reaches nothing', () => {
    const session = placed();
    session.update(0, at(0.05, 0.05), SEES_NOTHING, NONE);
    const lost = session.update(1, null, SEES_NOTHING, NONE);
    expect([lost.reach, lost.toNext_m]).toEqual([null, null]);
    expect(lost.next).toBe(3);
  });

  test('a reload goes on; another guide and strangers’ memories do not', () => {
    const memory = new Memory();
    const before = placed('', memory).update(0, at(0), SEES_NOTHING, NONE).guide;
    const again = new GuideSession(options(), MPI, memory);
    expect(again.update(0, at(0), SEES_NOTHING, NONE).guide).toEqual(before);
    const other = new GuideSession({ ...options(), kind: 'planes' }, MPI, memory);
    expect(other.update(0, at(0), SEES_NOTHING, NONE).phase).toBe('scan');
    memory.text = '{"kind":"plenoptic"';
    const stranger = new GuideSession(options(), MPI, memory);
    expect(stranger.update(0, at(0), SEES_NOTHING, NONE).phase).toBe('scan');
  });

  test('the way to the next target in words', () => {
    expect(steps([0.04, -0.02, 0.001])).toBe('4.0 cm right, 2.0 cm up');
    expect(steps([-0.001, 0.002, -0.3])).toBe('30 cm back');
    expect(steps([0, 0, 0])).toMatch(/blue line/);
  });
});
