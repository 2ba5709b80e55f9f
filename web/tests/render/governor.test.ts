import { describe, expect, test } from 'vitest';
import { Governor, governorOf, LEVELS, SLOW_MS } from '../../src/render/governor';

const LAST = LEVELS.length - 1;

/** A governor and its clock. */
class Clock {
  readonly governor: Governor;
  #now_ms = 1000;

  constructor(slow_ms?: number) {
    this.governor = new Governor(slow_ms);
    this.governor.frame(this.#now_ms);
  }

  /** Draw for so long, a frame every so often. Returns how often the level changed. */
  draw(seconds: number, frame_ms: number): number {
    let changes = 0;
    for (const end_ms = this.#now_ms + 1000 * seconds; this.#now_ms < end_ms;) {
      this.#now_ms += frame_ms;
      if (this.governor.frame(this.#now_ms)) changes += 1;
    }
    return changes;
  }

  /** The first level after so many seconds at most that a condition holds for; null when none. */
  secondsUntil(level: number, frame_ms: number, seconds: number): number | null {
    for (let passed = 0; passed < seconds; passed += 0.1) {
      if (this.governor.level === level) return passed;
      this.draw(0.1, frame_ms);
    }
    return null;
  }
}

describe('LEVELS', () => {
  test('resolution gives way first, then views, then alignment; nothing comes back on the way', () => {
    for (const [i, level] of LEVELS.slice(1).entries()) {
      const before = LEVELS[i];
      expect(before).toBeDefined();
      if (before === undefined) return;
      expect(level.pixels).toBeLessThanOrEqual(before.pixels);
      expect(level.blended).toBeLessThanOrEqual(before.blended);
      expect(level.filling).toBeLessThanOrEqual(before.filling);
      expect(level.alignEvery_ms).toBeGreaterThanOrEqual(before.alignEvery_ms);
      expect(level.rememberEvery).toBeGreaterThanOrEqual(before.rememberEvery);
    }
    const first = (changed: (level: (typeof LEVELS)[number]) => boolean): number => LEVELS.findIndex(changed);
    const pixels = first((level) => level.pixels < 1);
    const views = first((level) => level.blended < Infinity);
    const alignment = first((level) => level.alignEvery_ms > LEVELS[0].alignEvery_ms);
    expect([pixels, views > pixels, alignment > views]).toEqual([1, true, true]);
    expect(LEVELS[LAST]?.blended).toBeGreaterThan(0);
    expect(LEVELS[LAST]?.filling).toBeGreaterThan(0);
  });
});

describe('Governor', () => {
  test('a device that keeps up loses nothing', () => {
    for (const frame_ms of [8, 16.7, 33.3, 50]) {
      const clock = new Clock();
      expect(clock.draw(60, frame_ms)).toBe(0);
      expect(clock.governor.allowance).toBe(LEVELS[0]);
    }
  });

  test('four times as slow: something goes within two seconds, step by step, and then all that may', () => {
    const clock = new Clock();
    clock.draw(5, 33.3);
    expect(clock.secondsUntil(1, 133, 3)).toBeLessThan(2);
    expect(clock.secondsUntil(LAST, 133, 10)).not.toBeNull();
    expect(clock.draw(60, 133)).toBe(0);
  });

  test('it comes back, one level after another', () => {
    const clock = new Clock();
    clock.draw(10, 133);
    expect(clock.governor.level).toBe(LAST);
    for (let level = LAST - 1; level >= 0; level -= 1) {
      const before = clock.governor.level;
      const took = clock.secondsUntil(level, 33.3, 10);
      expect(clock.governor.level).toBe(before - 1);
      expect(took).toBeGreaterThan(1);
    }
    expect(clock.draw(60, 33.3)).toBe(0);
  });

  test('between fast and slow it stays', () => {
    const clock = new Clock();
    clock.secondsUntil(1, 133, 3);
    clock.draw(3, 48); // until what was before is forgotten
    const { level } = clock.governor;
    expect(level).toBeGreaterThan(0);
    expect(clock.draw(60, 48)).toBe(0);
    expect(clock.governor.level).toBe(level);
  });

  test('what is given back too early is tried ever more rarely', () => {
    const clock = new Clock();
    // A device that keeps up at the second level, not at the first.
    const changesIn = (seconds: number): number => {
      let changes = 0;
      for (let passed = 0; passed < seconds; passed += 0.1) {
        changes += clock.draw(0.1, clock.governor.level === 0 ? 70 : 30);
      }
      return changes;
    };
    const first = changesIn(60);
    const later = changesIn(60);
    expect(first).toBeGreaterThan(2);
    expect(later).toBeLessThan(first);
    expect(later).toBeLessThanOrEqual(4);
  });

  test('after a relapse it is patient again only once a level has held', () => {
    const clock = new Clock();
    for (let turn = 0; turn < 4; turn += 1) { // given back, and too slow again at once
      clock.secondsUntil(1, 70, 10);
      clock.secondsUntil(0, 30, 60);
    }
    clock.draw(30, 30);
    clock.secondsUntil(1, 70, 10);
    expect(clock.secondsUntil(0, 30, 60)).toBeLessThan(5);
  });

  test('a page that was hidden, one long frame and a clock that stands are no alarm', () => {
    const clock = new Clock();
    for (const gap_ms of [300, 5000, 3_600_000]) {
      clock.draw(5, 33.3);
      expect(clock.draw(gap_ms / 1000, gap_ms)).toBe(0);
      expect(clock.draw(5, 33.3)).toBe(0);
    }
    expect(new Governor().frame(NaN)).toBe(false);
    const still = new Governor();
    for (let i = 0; i < 1000; i += 1) expect(still.frame(5)).toBe(false);
  });

  test('what counts as slow may be told', () => {
    const clock = new Clock(10 * SLOW_MS);
    expect(clock.draw(20, 300)).toBe(0);
    expect(clock.draw(3, 700)).toBeGreaterThan(0);
  });
});

describe('governorOf', () => {
  const asked = (query: string, marks: 'apart' | 'paper' = 'apart'): Governor | null =>
    governorOf(new URLSearchParams(query), { marks });

  test('is there unless it is not wanted, or the marks are the paper\'s', () => {
    expect(asked('')?.slow_ms).toBe(SLOW_MS);
    expect(asked('governor=200')?.slow_ms).toBe(200);
    expect(asked('governor=off')).toBeNull();
    expect(asked('', 'paper')).toBeNull();
  });

  test.each(['on', '', '0', '-5', 'Infinity'])('%s is refused', (value) => {
    expect(() => asked(`governor=${value}`)).toThrow(/governor must be/);
  });
});
