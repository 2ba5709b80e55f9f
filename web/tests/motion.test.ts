import { describe, expect, test } from 'vitest';
import { rigid, type Camera } from '../src/geometry';
import { Motion } from '../src/motion';

const PINHOLE = { width_px: 4, height_px: 4, fx_px: 4, fy_px: 4, cx_px: 2, cy_px: 2 };

function cameraAt(x_m: number, turn_rad = 0): Camera {
  const c = Math.cos(turn_rad);
  const s = Math.sin(turn_rad);
  return { pinhole: PINHOLE, worldFromCam: rigid([c, 0, s, x_m, 0, 1, 0, 0, -s, 0, c, 0]) };
}

function walk(motion: Motion, speed_m_per_s: number, turn_rad_per_s = 0): void {
  for (let t_ms = 0; t_ms <= 1000; t_ms += 33) {
    motion.update(t_ms, cameraAt((speed_m_per_s * t_ms) / 1000, (turn_rad_per_s * t_ms) / 1000));
  }
}

describe('Motion', () => {
  test('a slow walk is fine, a run is too fast', () => {
    const slow = new Motion();
    walk(slow, 0.4);
    expect(slow.tooFast).toBe(false);
    const run = new Motion();
    walk(run, 1.5);
    expect(run.tooFast).toBe(true);
  });

  test('a picture is steady only when the phone is held nearly still', () => {
    const motion = new Motion();
    expect(motion.steady).toBe(false); // nothing is known
    walk(motion, 0.1);
    expect(motion.steady).toBe(true);
    walk(motion, 0.4);
    expect(motion.steady).toBe(false);
    walk(motion, 0, 0.6);
    expect(motion.steady).toBe(false);
    motion.update(1033, null);
    expect(motion.steady).toBe(false);
  });

  test('turning counts too', () => {
    const motion = new Motion();
    walk(motion, 0, 2);
    expect(motion.tooFast).toBe(true);
  });

  test('one jump of the tracking is forgotten within a second', () => {
    const motion = new Motion();
    motion.update(0, cameraAt(0));
    motion.update(33, cameraAt(0.2));
    for (let t_ms = 66; t_ms < 1000; t_ms += 33) motion.update(t_ms, cameraAt(0.2));
    expect(motion.tooFast).toBe(false);
  });

  test('nothing is known after tracking was lost', () => {
    const motion = new Motion();
    walk(motion, 3);
    motion.update(1033, null);
    motion.update(1066, cameraAt(50));
    expect(motion.tooFast).toBe(false);
  });
});
