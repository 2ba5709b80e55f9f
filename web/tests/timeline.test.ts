import { expect, test } from 'vitest';
import { Timeline } from '../src/timeline';

test('the first time counts', () => {
  const timeline = new Timeline();
  timeline.mark('a', 'shutter', 10);
  timeline.mark('a', 'drawn', 400);
  timeline.mark('a', 'drawn', 500);
  timeline.mark('b', 'shutter', 20);
  expect(timeline.all()).toEqual([
    { id: 'a', times: { shutter: 10, drawn: 400 } },
    { id: 'b', times: { shutter: 20 } },
  ]);
  expect(timeline.has('a', 'drawn')).toBe(true);
  expect(timeline.has('b', 'drawn')).toBe(false);
});
