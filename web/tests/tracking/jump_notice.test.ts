import { expect, test } from 'vitest';
import { JumpNotice } from '../../src/tracking/jump_notice';

const NEVER = { followed: 0, lost: 0 };

test('a jump is said for some seconds, however it was noticed', () => {
  const notice = new JumpNotice();
  expect(notice.of(0, 0, NEVER)).toBeNull();
  expect(notice.of(100, 1, NEVER)).toContain('moved along');
  expect(notice.of(6000, 1, NEVER)).toContain('moved along');
  expect(notice.of(6200, 1, NEVER)).toBeNull();
  expect(notice.of(7000, 1, { followed: 1, lost: 0 })).toContain('moved along');
  expect(notice.of(14_000, 1, { followed: 1, lost: 0 })).toBeNull();
});

test('a world that is lost stays said', () => {
  const notice = new JumpNotice();
  expect(notice.of(0, 0, { followed: 0, lost: 1 })).toContain('new session');
  expect(notice.of(60_000, 0, { followed: 0, lost: 1 })).toContain('new session');
});
