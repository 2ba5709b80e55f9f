import { describe, expect, test } from 'vitest';
import { percent, ShareHistory } from '../../src/ui/share_graph';
import { PAPER_PEAKED_SHARE } from '../../src/wire';

describe('percent', () => {
  test.each([
    [null, '–'], [0, '0.0 %'], [0.0001, '<0.1 %'], [0.001, '0.1 %'], [0.0428, '4.3 %'],
    [0.0999, '10.0 %'], [0.1, '10 %'], [0.256, '26 %'], [1, '100 %'],
  ])('%s is %s', (share, text) => {
    expect(percent(share)).toBe(text);
  });
});

describe('the last minute', () => {
  test('at most one share every half second is kept', () => {
    const history = new ShareHistory();
    const kept = [0, 100, 499, 500, 900, 1000].map((time_ms) => history.add(time_ms, 0.1));
    expect(kept).toEqual([true, false, false, true, false, true]);
    expect(history.points.map(({ time_ms }) => time_ms)).toEqual([0, 500, 1000]);
  });

  test('what is older than a minute goes, views too', () => {
    const history = new ShareHistory();
    history.add(0, 0.9);
    history.shot(0);
    history.shot(2000);
    history.add(1000, 0.2);
    history.add(60_500, 0.1);
    expect(history.points.map(({ time_ms }) => time_ms)).toEqual([1000, 60_500]);
    expect(history.shots_ms).toEqual([2000]);
  });

  test('the scale holds the goal, and all that is shown', () => {
    const history = new ShareHistory();
    expect(history.top).toBeCloseTo(2.5 * PAPER_PEAKED_SHARE);
    history.add(0, 0.05);
    expect(history.top).toBeCloseTo(2.5 * PAPER_PEAKED_SHARE);
    history.add(1000, 0.4);
    expect(history.top).toBe(0.4);
  });
});

/** Notes where lines go. */
class Pen {
  readonly lines: string[] = [];
  readonly bars: number[] = [];
  #line = '';
  strokeStyle = '';
  fillStyle = '';
  lineWidth = 1;
  lineJoin = '';

  clearRect(): void { this.lines.length = 0; }
  setLineDash(): void { /* not looked at */ }
  beginPath(): void { this.#line = ''; }
  moveTo(x: number, y: number): void { this.#line += `M${x} ${y.toFixed(1)}`; }
  lineTo(x: number, y: number): void { this.#line += `L${x} ${y.toFixed(1)}`; }
  stroke(): void { this.lines.push(this.#line); }
  fillRect(x: number): void { this.bars.push(x); }
}

test('the newest share is at the right edge, half a minute ago in the middle', () => {
  const history = new ShareHistory();
  history.add(30_000, 0);
  history.shot(45_000);
  history.add(60_000, 0.2);
  const pen = new Pen();
  const canvas = { width: 120, height: 44, getContext: () => pen };
  history.draw(canvas as unknown as HTMLCanvasElement);
  // Two pixels stay free above and below: 0 is at 42, the top (0.2) at 2, the goal between them.
  const goal = (42 - 40 * (PAPER_PEAKED_SHARE / 0.2)).toFixed(1);
  expect(pen.lines).toEqual([`M0 ${goal}L120 ${goal}`, 'L60 42.0L120 2.0']);
  expect(pen.bars).toEqual([89]); // 15 s ago: 90, two pixels wide
});

test('nothing is drawn before the first share', () => {
  const pen = new Pen();
  const canvas = { width: 120, height: 44, getContext: () => pen };
  new ShareHistory().draw(canvas as unknown as HTMLCanvasElement);
  expect(pen.lines).toEqual([]);
});
