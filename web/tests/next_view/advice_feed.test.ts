import { expect, test } from 'vitest';
import { AdviceFeed } from '../../src/next_view/advice_feed';
import { doneText } from '../../src/next_view/words';
import { ApiError } from '../../src/server/api';
import type { Guidance } from '../../src/wire';

function guidance(revision: number): Guidance {
  return { revision, views: 1, score: 0.5, verdict: 'go on', curve: [], next: null, left: [], surface_m: [] };
}

/** A server that answers when it is told to. */
class Server {
  asked = 0;
  readonly #waiting: { resolve: (answer: Guidance) => void; reject: (error: unknown) => void }[] = [];

  guidance(): Promise<Guidance> {
    this.asked += 1;
    return new Promise((resolve, reject) => { this.#waiting.push({ resolve, reject }); });
  }

  async answer(revision: number): Promise<void> {
    this.#waiting.shift()?.resolve(guidance(revision));
    await settled();
  }

  async fail(error: unknown): Promise<void> {
    this.#waiting.shift()?.reject(error);
    await settled();
  }
}

async function settled(): Promise<void> {
  for (let i = 0; i < 10; i += 1) await Promise.resolve();
}

function opened(): { server: Server; feed: AdviceFeed; heard: number[] } {
  const server = new Server();
  const heard: number[] = [];
  const feed = new AdviceFeed(server, 'session', ({ revision }) => heard.push(revision));
  return { server, feed, heard };
}

test('news are asked for once, and what comes meanwhile once more', async () => {
  const { server, feed, heard } = opened();
  feed.heard(1);
  feed.heard(1);
  feed.heard(2);
  feed.heard(3);
  expect(server.asked).toBe(1);
  await server.answer(5);
  expect(server.asked).toBe(2);
  await server.answer(6);
  feed.heard(3);
  expect(server.asked).toBe(2);
  expect(heard).toEqual([5, 6]);
  expect(feed.newest?.revision).toBe(6);
});

test('none yet, and the same again, are no news', async () => {
  const { server, feed, heard } = opened();
  for (const [news, revision] of [[1, 0], [2, 4], [3, 4]] as const) {
    feed.heard(news);
    await server.answer(revision);
  }
  expect(heard).toEqual([4]);
});

test('after a failure the next news ask again', async () => {
  const { server, feed, heard } = opened();
  feed.heard(1);
  await server.fail(new ApiError(503, 'busy'));
  feed.heard(2);
  await server.answer(2);
  expect(heard).toEqual([2]);
});

test('all is all, and not less', () => {
  expect(doneText({ score: 0.829 })).toBe('Done 82\u00a0%');
  expect(doneText({ score: 0.999 })).toBe('Done 99\u00a0%');
});
