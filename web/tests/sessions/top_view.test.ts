import { expect, test } from 'vitest';
import { drawShares } from '../../src/sessions/share_chart';
import { drawTopView, topViewOf } from '../../src/sessions/top_view';
import type { Capture, PeakedSample } from '../../src/wire';

const PINHOLE = { width_px: 4, height_px: 8, fx_px: 4, fy_px: 4, cx_px: 2, cy_px: 4 };

/** A camera of a y-up world that looks along -z, at x and z. */
function capture(number: number, x_m: number, z_m: number, removed = false): Capture {
  return {
    id: `capture-${number}`, number, time_s: 100 + number, state: 'ready', removed,
    camera: {
      pinhole: PINHOLE, world_from_cam: [1, 0, 0, x_m, 0, -1, 0, 1.4, 0, 0, -1, z_m],
    },
  };
}

function sample(time_s: number, share: number): PeakedSample {
  return {
    time_s, peaked_share: share, views: 1,
    world_from_cam: [1, 0, 0, 0, 0, -1, 0, 1.4, 0, 0, -1, 0],
  };
}

test('ahead is up, right is right', () => {
  const { views } = topViewOf([capture(1, 0, 0), capture(2, 0.5, -1)], []);
  const [first, second] = views;
  expect(first?.ahead.map((v) => Math.round(v * 1e6) / 1e6 + 0)).toEqual([0, -1]);
  expect(second?.at[0]).toBeCloseTo(0.5, 9);
  expect(second?.at[1]).toBeCloseTo(-1, 9);
});

test('undone views are not drawn', () => {
  expect(topViewOf([capture(1, 0, 0), capture(2, 1, 0, true)], []).views).toHaveLength(1);
});

test('a camera that looks straight down has a place too', () => {
  const down = capture(1, 0, 0);
  const pose = [1, 0, 0, 0, 0, 0, -1, 2, 0, 1, 0, 0];
  const view = topViewOf([{ ...down, camera: { pinhole: PINHOLE, world_from_cam: pose } }], []);
  expect(view.views[0]?.at.every(Number.isFinite)).toBe(true);
});

test('nothing is drawn of nothing, and no NaN of something', () => {
  expect(drawTopView(topViewOf([], []))).toBe('');
  expect(drawShares([], [])).toBe('');
  const samples = [sample(100, 0.3), sample(104, 0.02)];
  expect(drawTopView(topViewOf([capture(1, 0, 0)], samples))).not.toContain('NaN');
  expect(drawShares(samples, [capture(1, 0, 0)])).not.toContain('NaN');
  expect(drawShares([sample(100, 0)], [])).not.toContain('NaN');
});
