import { afterEach, beforeEach, expect, test, vi } from 'vitest';

import { ApiError } from '../../src/server/api';
import { DraftKeeper, type Keeping } from '../../src/study/draft_keeper';
import type { Answers } from '../../src/study/study_api';
import { MapStorage } from './support';

beforeEach(() => { vi.useFakeTimers(); });
afterEach(() => { vi.useRealTimers(); });

function keeperThat(send: (answers: Answers) => Promise<unknown>, storage = new MapStorage()) {
  const said: Keeping[] = [];
  const keeper = new DraftKeeper('draft', send, (how) => said.push(how), storage);
  return { keeper, said, storage };
}

test('changes of a moment go out together, and only what changed', async () => {
  const sent: Answers[] = [];
  const { keeper, said, storage } = keeperThat(async (answers) => void sent.push(answers));
  keeper.change('q1', 3);
  keeper.change('q2', 4);
  await vi.advanceTimersByTimeAsync(1000);
  keeper.change('q2', 5);
  await vi.advanceTimersByTimeAsync(1000);
  expect(sent).toEqual([{ q1: 3, q2: 4 }, { q2: 5 }]);
  expect(said.at(-1)).toBe('saved');
  expect(storage.values.size).toBe(0);
});

test('without a network it stays on the device, says so, and goes out later', async () => {
  let online = false;
  const sent: Answers[] = [];
  const { keeper, said, storage } = keeperThat(async (answers) => {
    if (!online) throw new ApiError(0, 'no answer');
    sent.push(answers);
  });
  keeper.change('q1', 3);
  await vi.advanceTimersByTimeAsync(4000);
  expect(said.at(-1)).toBe('not_saved');
  expect(storage.values.size).toBe(1);
  online = true;
  await vi.advanceTimersByTimeAsync(4000);
  expect(sent).toEqual([{ q1: 3 }]);
  expect(storage.values.size).toBe(0);
});

test('a reload finds what was not sent, and sends it', async () => {
  const storage = new MapStorage();
  keeperThat(() => Promise.reject(new ApiError(0, 'no answer')), storage).keeper.change('q1', 3);
  const sent: Answers[] = [];
  const { keeper } = keeperThat(async (answers) => void sent.push(answers), storage);
  expect(keeper.unsent).toEqual({ q1: 3 });
  await vi.advanceTimersByTimeAsync(100);
  expect(sent).toEqual([{ q1: 3 }]);
});

test('a change while one is sent goes out after it', async () => {
  const sent: Answers[] = [];
  let answer: () => void = () => undefined;
  const { keeper } = keeperThat((answers) => new Promise<void>((resolve) => {
    sent.push(answers);
    answer = resolve;
  }));
  keeper.change('q1', 3);
  await vi.advanceTimersByTimeAsync(600);
  keeper.change('q1', 4);
  answer();
  await vi.advanceTimersByTimeAsync(2000);
  expect(sent).toEqual([{ q1: 3 }, { q1: 4 }]);
});

test('what another tab has handed in is not kept, and a closed form sends nothing', async () => {
  const sent: Answers[] = [];
  const { keeper, storage } = keeperThat(async (answers) => {
    sent.push(answers);
    throw new ApiError(409, 'another turn');
  });
  keeper.change('q1', 3);
  await vi.advanceTimersByTimeAsync(5000);
  expect(sent).toHaveLength(1);
  expect(storage.values.size).toBe(0);
  keeper.change('q1', 4);
  keeper.close();
  await vi.advanceTimersByTimeAsync(5000);
  expect(sent).toHaveLength(1);
});
