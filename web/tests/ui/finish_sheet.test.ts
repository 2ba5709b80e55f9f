import { expect, test } from 'vitest';

import type { CapturedView, ViewState } from '../../src/capture/capture_state';
import { enoughText, gotText, onTheWayText } from '../../src/ui/finish_sheet';
import { drawQuality } from '../../src/ui/quality_curve';
import type { CaptureDecision, Selection } from '../../src/wire';

type Faults = NonNullable<CaptureDecision['faults']>;

function viewsIn(...states: readonly ViewState[]): CapturedView[] {
  return states.map((state) => ({ state }) as unknown as CapturedView);
}

function decision(faults: Faults = []): CaptureDecision {
  return { id: 'c0ffee00', number: 1, kept: true, reason: '', faults };
}

function selected(enough: number, psnr_db: readonly number[], faults: readonly Faults[] = []): Selection {
  return {
    policy: 'peaking', enough, captures: psnr_db.map((_, i) => decision(faults[i])),
    curve: psnr_db.map((each, i) => ({ num_views: i + 1, psnr_db: each })),
  };
}

test('it says what was got', () => {
  const views = viewsIn('ready', 'ready', 'ready');
  expect(gotText(views, null)).toBe('3 views.');
  expect(gotText(views, selected(3, [1, 2, 3]))).toBe('3 views, none blurred, exposure even.');
  expect(gotText(views, selected(3, [1, 2, 3], [['blurred', 'darker'], ['brighter'], []])))
    .toBe('3 views, 1 blurred, exposure jumps at 2.');
  expect(gotText(viewsIn('ready', 'failed'), selected(1, [1])))
    .toBe('2 views, 1 failed (the list of views says why), none blurred, exposure even.');
});

test('how many are enough is said with what they lack', () => {
  expect(enoughText(selected(2, [10, 20, 20.3]))).toBe('The best 2 show nearly the same: 0.3 dB less.');
  expect(enoughText(selected(2, [10, 20, 20.02]))).toBe('The best 2 show the same.');
  expect(enoughText(selected(3, [10, 20, 30]))).toBe('Each of them shows what the others do not.');
  expect(enoughText(selected(1, [10]))).toBe('');
  expect(enoughText({ policy: 'peaking', captures: [] })).toBe('');
});

test('what is still on its way is said', () => {
  expect(onTheWayText(viewsIn('ready', 'failed'))).toBe('');
  expect(onTheWayText(viewsIn('ready', 'queued'))).toBe('The server is still at work on 1 view.');
  expect(onTheWayText(viewsIn('waiting', 'uploading', 'queued'))).toContain('2 of 3 views still on the way');
});

test('the curve rises from left to right, and has a mark', () => {
  const svg = drawQuality(selected(2, [10, 20, 21]).curve ?? [], 2, 3);
  expect(svg).toContain('d="M6.0 80.0L160.0 27.3L314.0 22.0"');
  expect(svg).toContain('M160.0 16V98');
  expect(svg).toContain('2 of 3');
  expect(drawQuality([{ num_views: 1, psnr_db: 10 }], 1, 1)).toBe('');
});
