/** Whatever goes wrong on the way: at the end the server has every capture once, no undone one. */

import 'fake-indexeddb/auto';

import { expect, test } from 'vitest';

import { ModelServer, type Fault } from './model_server';
import { ModelBrowser, ModelClock, photo, settle } from './support';

/** Mulberry32. */
function randomOf(seed: number): () => number {
  let a = seed;
  return () => {
    a = (a + 0x6d2b79f5) | 0;
    let t = Math.imul(a ^ (a >>> 15), 1 | a);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
}

const FAULTS: readonly Fault[] = ['refused', 'reply lost', 'late', 503, 507, 500];

test.each([1, 2, 3, 4, 5, 6, 7, 8])('seed %i', async (seed) => {
  const random = randomOf(seed);
  const server = new ModelServer();
  const clock = new ModelClock(random);
  const browser = new ModelBrowser(server, clock);
  server.fault = () => random() < 0.4
    ? FAULTS[Math.floor(random() * FAULTS.length)] ?? null : null;
  let session = await browser.open();
  const wanted = new Set<string>();
  for (let step = 0; step < 60; step++) {
    const chance = random();
    if (chance < 0.4) wanted.add(await session.shutter(photo(step)));
    else if (chance < 0.55) {
      const id = [...wanted][Math.floor(random() * wanted.size)];
      if (id === undefined) continue;
      wanted.delete(id);
      await session.undo(id);
    } else if (chance < 0.65) server.stop();
    else if (chance < 0.8) server.start();
    else if (chance < 0.87) {
      browser.close();
      session = await browser.open();
    } else if (chance < 0.92) await server.deliverLate();
    else await settle();
  }
  server.start();
  server.fault = () => null;
  await server.deliverLate();
  await clock.until(() => server.alive().sort().join() === [...wanted].sort().join()
    && session.views.every(({ state }) => state === 'queued')
    && session.views.length === wanted.size);
  expect([...server.writes.values()].every((count) => count === 1)).toBe(true);
  for (const id of wanted) expect(await session.photo(id)).toBeNull();
  browser.close();
});
