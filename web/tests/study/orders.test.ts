import { expect, test } from 'vitest';

import { ApiError, NotUnderstood } from '../../src/server/api';
import { Orders } from '../../src/study/orders';

const NO_ANSWER = new ApiError(0, 'no answer');

function ordersThat() {
  const said = { silent: 0, ids: 0 };
  const orders = new Orders({
    onSilence: () => { said.silent += 1; },
    pacing: { sleep: () => Promise.resolve(), random: () => 0 },
    newId: () => `order-${said.ids += 1}`,
  });
  return { orders, said };
}

/** Keeps each id once and loses its first answers, as a bad network does. */
function serverLosing(answers: number) {
  const kept = new Set<string>();
  let lost = 0;
  const send = async (id: string): Promise<number> => {
    kept.add(id);
    if (lost++ < answers) throw NO_ANSWER;
    return kept.size;
  };
  return { kept, send };
}

test('an order whose answer is lost is sent again and counts once', async () => {
  const { orders, said } = ordersThat();
  const { kept, send } = serverLosing(2);
  expect(await orders.give('note', send)).toBe(1);
  expect(said.silent).toBe(2);
  expect([...kept]).toEqual(['order-1']);
});

test('the same order, given later, is another one', async () => {
  const { orders } = ordersThat();
  const { kept, send } = serverLosing(0);
  await orders.give('note', send);
  await orders.give('note', send);
  expect([...kept]).toEqual(['order-1', 'order-2']);
});

test('while an order waits for its answer, the same one is not sent', async () => {
  const { orders } = ordersThat();
  const { kept, send } = serverLosing(1);
  const first = orders.give('add', send);
  const others = [orders.give('add', send), orders.give('note', send)];
  expect(await first).not.toBeNull();
  expect(await others[0]).toBeNull();
  expect(kept.size).toBe(2);
  await Promise.all(others);
});

test('what the server refuses is not sent again', async () => {
  for (const refusal of [new ApiError(409, 'not now'), new NotUnderstood('?'), new TypeError()]) {
    const { orders, said } = ordersThat();
    await expect(orders.give('note', () => Promise.reject(refusal))).rejects.toBe(refusal);
    expect(said.silent).toBe(0);
  }
});
