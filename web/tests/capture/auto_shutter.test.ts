import { describe, expect, test } from 'vitest';
import {
  AutoShutter, LASTS_MS, PATIENCE_MS, PAUSE_MS, WORTH_SHARE, type AutoMoment, type AutoWait,
} from '../../src/capture/auto_shutter';

const FRAME_MS = 33;

function moment(change: Partial<AutoMoment> = {}): AutoMoment {
  return { time_ms: 0, hindrance: null, fault: null, steady: true, views: 3, ready: 3, peakedShare: 0.05, ...change };
}

function auto(): AutoShutter {
  const shutter = new AutoShutter();
  shutter.on = true;
  return shutter;
}

/** Times at which views are taken while the moment lasts. */
function takenAt(shutter: AutoShutter, lasts_ms: number, change: Partial<AutoMoment> = {}, from_ms = 0): number[] {
  const times: number[] = [];
  for (let t = from_ms; t < from_ms + lasts_ms; t += FRAME_MS) {
    if (shutter.look(moment({ ...change, time_ms: t }))) times.push(t);
  }
  return times;
}

describe('the automatic shutter', () => {
  test('takes a view once what is missing has lasted', () => {
    const times = takenAt(auto(), PAUSE_MS - FRAME_MS);
    expect(times).toHaveLength(1);
    expect(times[0]).toBeGreaterThanOrEqual(LASTS_MS);
    expect(times[0]).toBeLessThan(LASTS_MS + 2 * FRAME_MS);
  });

  test('leaves a pause between two', () => {
    const times = takenAt(auto(), 5 * PAUSE_MS);
    expect(times.length).toBeGreaterThan(3);
    const pauses = times.slice(1).map((time, i) => time - (times[i] ?? time));
    expect(Math.min(...pauses)).toBeGreaterThanOrEqual(PAUSE_MS);
  });

  test.each<[AutoWait, Partial<AutoMoment>]>([
    ['first-view', { views: 0, ready: 0, peakedShare: null }],
    ['too-fast', { hindrance: 'too-fast' }],
    ['other', { hindrance: 'other' }],
    ['blurred', { fault: 'blurred' }],
    ['too-dark', { fault: 'too-dark' }],
    ['unsteady', { steady: false }],
    ['nothing-new', { peakedShare: WORTH_SHARE - 1e-6 }],
    ['nothing-new', { peakedShare: null }],
    ['nothing-new', { peakedShare: null, fault: 'too-bright' }],
  ])('waits, and says why: %s', (why, change) => {
    const shutter = auto();
    expect(takenAt(shutter, 3 * PAUSE_MS, change)).toEqual([]);
    expect(shutter.waits).toBe(why);
    expect(shutter.sentence).toMatch(/^Auto: /);
  });

  test('waits for the view it took, but not for ever', () => {
    const shutter = auto();
    const [first = 0] = takenAt(shutter, PAUSE_MS);
    const later = takenAt(shutter, PATIENCE_MS + 1000, { views: 4, ready: 3 }, PAUSE_MS);
    expect(later[0]).toBeGreaterThanOrEqual(first + PATIENCE_MS);
  });

  test('a flicker of red is no reason', () => {
    const shutter = auto();
    for (let t = 0; t < 3000; t += FRAME_MS) {
      const peakedShare = Math.floor(t / 100) % 2 === 0 ? 0.2 : 0;
      expect(shutter.look(moment({ time_ms: t, peakedShare }))).toBe(false);
    }
  });

  test('says nothing when it is off', () => {
    expect(new AutoShutter().sentence).toBeNull();
  });
});
