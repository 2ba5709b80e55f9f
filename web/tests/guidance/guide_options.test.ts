import { describe, expect, test } from 'vitest';
import { guideOptionsOf, NoSuchGuide } from '../../src/guidance/guide_options';

const of = (query: string): ReturnType<typeof guideOptionsOf> =>
  guideOptionsOf(new URLSearchParams(query));

describe('the address', () => {
  test('without a guide there is none', () => expect(of('source=virtual')).toBeNull());

  test('the paper by default', () => {
    const options = of('guide=plenoptic');
    expect(options?.areaSide_m).toBe(0.15);
    expect(options?.autoShutter).toBe(false);
    expect(options?.nearEnough).toEqual({});
  });

  test('everything as asked', () => {
    const options = of('guide=hemisphere&area=0.3&near=0.02&angle=15&shutter=auto&step=30&extent=90');
    expect(options).toMatchObject({ kind: 'hemisphere', areaSide_m: 0.3, autoShutter: true });
    expect(options?.nearEnough.position_m).toBe(0.02);
    expect(options?.nearEnough.direction_rad).toBeCloseTo(Math.PI / 12, 12);
    expect([options?.step_rad, options?.extent_rad]).toEqual([Math.PI / 6, Math.PI / 2]);
  });

  test.each([
    'guide=', 'guide=grid', 'guide=planes&area=0', 'guide=planes&area=', 'guide=planes&near=x',
    'guide=planes&angle=NaN', 'guide=planes&shutter=always', 'guide=hemisphere&step=0',
  ])('%s is refused', (query) => expect(() => of(query)).toThrow(NoSuchGuide));
});
