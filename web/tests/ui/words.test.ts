import { expect, test } from 'vitest';
import { trackingText, viewsText } from '../../src/ui/words';

test.each([
  [0.006, 0.0052, 'tracking off by 6 mm, 0.3°'],
  [0, 0, 'tracking off by 0 mm, 0.0°'],
  [0.0124, 0.02, 'tracking off by 12 mm, 1.1°'],
])('%s m and %s rad', (moved_m, turned_rad, text) => {
  expect(trackingText({ moved_m, turned_rad })).toBe(text);
});

test('what nobody knows is not said', () => {
  expect(trackingText({ moved_m: null, turned_rad: null })).toBe('');
});

test('views are counted', () => {
  expect([viewsText(1), viewsText(2)]).toEqual(['1 view', '2 views']);
});
