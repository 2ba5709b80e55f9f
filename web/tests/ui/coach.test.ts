import { describe, expect, test } from 'vitest';
import { Coach, NUM_TASKS, taskOf, type CoachMoment } from '../../src/ui/coach';

/** The step after each of these moments. */
function stepsOf(coach: Coach, ...moments: readonly (readonly [number, number, number | null])[]): number[] {
  return moments.map(([views, ready, peakedShare]) => {
    const moment: CoachMoment = { views, ready, peakedShare };
    coach.update(moment);
    return coach.task;
  });
}

describe('shoot – move – shoot the red – see it go', () => {
  test('each step is taken by doing it', () => {
    const coach = new Coach();
    expect(stepsOf(coach,
      [0, 0, null], // looks around
      [1, 0, null], // pressed, but the view does not take part yet
      [1, 1, 0.01], // takes part
      [1, 1, 0.05], // moves; little red
      [1, 1, 0.07], // red
      [1, 1, 0.2], // more of it
      [2, 1, 0.2], // pressed
      [2, 1, 0.1], // the second view is on its way: moving back is not learning
      [2, 2, 0.17], // takes part, but the red is still there (0.8 of 0.2 is 0.16)
      [2, 2, 0.15], // it goes
    )).toEqual([0, 0, 1, 1, 2, 2, 3, 3, 3, 4]);
    expect(coach.done).toBe(true);
  });

  test('a view before the red is seen does not count as the one that takes it away', () => {
    const coach = new Coach();
    stepsOf(coach, [1, 1, 0], [2, 2, 0.02], [2, 2, 0.1]);
    expect(coach.task).toBe(2);
    expect(stepsOf(coach, [2, 2, 0.1], [3, 2, 0.1])).toEqual([2, 3]);
  });

  test('who has pressed is not asked to press again', () => {
    const coach = new Coach();
    expect(coach.waits({ views: 0, ready: 0, peakedShare: null })).toBe(false);
    expect(coach.waits({ views: 1, ready: 0, peakedShare: null })).toBe(true);
    stepsOf(coach, [1, 1, 0]);
    expect(coach.waits({ views: 1, ready: 1, peakedShare: 0 })).toBe(false);
  });

  test('what was marked and is calm again is not asked for', () => {
    const coach = new Coach();
    expect(stepsOf(coach, [1, 1, 0], [1, 1, 0.1], [1, 1, 0.01], [1, 1, 0.1])).toEqual([1, 2, 1, 2]);
  });

  test('says what is true of the way views are taken', () => {
    const all = [true, false].flatMap((auto) => [true, false].map((isRecording) => ({ auto, isRecording })));
    for (const way of all) {
      const said = Array.from({ length: NUM_TASKS }, (_, task) => Object.values(taskOf(task, way) ?? {}).join(' '));
      expect(new Set(said).size).toBe(NUM_TASKS);
      expect(said.join(' ').includes('step')).toBe(!way.isRecording);
      expect(said[2]?.includes('Auto')).toBe(way.auto);
    }
    expect(taskOf(NUM_TASKS, { auto: false, isRecording: false })).toBeUndefined();
  });

  test('after the last step nothing happens', () => {
    const coach = new Coach();
    coach.task = NUM_TASKS;
    expect(stepsOf(coach, [0, 0, null], [5, 5, 0.5])).toEqual([4, 4]);
  });

  test('again from the beginning', () => {
    const coach = new Coach();
    coach.task = NUM_TASKS;
    coach.restart();
    expect([coach.task, coach.done]).toEqual([0, false]);
    expect(stepsOf(coach, [3, 3, 0.3], [3, 3, 0.3], [4, 3, 0.3], [4, 4, 0.1])).toEqual([1, 2, 3, 4]);
  });
});
