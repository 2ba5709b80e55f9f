import { expect, test } from 'vitest';

import { ApiError } from '../../src/server/api';
import { COMPILING, SILENT, STARTING, Warmth } from '../../src/server/warmth';
import type { ServerInfo } from '../../src/wire';
import { settle } from '../capture/support';

type Answer = Pick<ServerInfo, 'warm' | 'warm_share'> | null;

/** A server that gives these answers, one at each step; null is none. */
function serverOf(...answers: Answer[]) {
  const steps: (() => void)[] = [];
  const api = {
    server: () => {
      const answer = answers.shift();
      return answer == null ? Promise.reject(new ApiError(0, 'no answer')) : Promise.resolve(answer as ServerInfo);
    },
  };
  const pacing = {
    sleep: () => new Promise<void>((resolve) => void steps.push(resolve)), random: () => 0,
  };
  const step = async (): Promise<void> => {
    steps.shift()?.();
    await settle();
  };
  return { api, pacing, step, waits: () => steps.length };
}

const COLD = { warm: false, warm_share: 0 };
const HALF = { warm: false, warm_share: 0.5 };
const WARM = { warm: true, warm_share: 1 };

test('a server on its first start is asked until it is ready', async () => {
  const { api, pacing, step, waits } = serverOf(COLD, HALF, null, HALF, WARM);
  const told: (number | null)[] = [];
  const warmth: Warmth = new Warmth(api, COLD, () => told.push(warmth.share), pacing);
  expect([warmth.isWarm, warmth.share, warmth.sentence]).toEqual([false, 0, STARTING]);
  await settle();
  await step();
  expect([warmth.share, warmth.sentence]).toEqual([0.5, COMPILING]);
  await step();
  expect([warmth.share, warmth.sentence]).toEqual([0.5, SILENT]);
  await step();
  await step();
  expect([warmth.isWarm, warmth.share, warmth.sentence]).toEqual([true, null, null]);
  expect(waits()).toBe(0);
  expect(told).toEqual([0.5, 0.5, 0.5, null]); // only what is new
});

test('a server that is ready is asked only when it may be another one', async () => {
  const { api, pacing, step } = serverOf(COLD, WARM);
  const warmth = new Warmth(api, WARM, () => undefined, pacing);
  expect([warmth.isWarm, warmth.sentence]).toEqual([true, null]);
  void warmth.ask();
  void warmth.ask(); // at once: one is enough
  await settle();
  expect(warmth.share).toBe(0);
  await step();
  expect(warmth.isWarm).toBe(true);
});

test('a share of all is not yet ready', () => {
  const { api, pacing } = serverOf();
  const warmth = new Warmth(api, { warm: false, warm_share: 1 }, () => undefined, pacing);
  expect(warmth.isWarm).toBe(false);
  expect(warmth.share).toBeLessThan(1);
});
