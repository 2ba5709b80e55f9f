/** Which camera the page begins with. */

import type { SourceKind } from './sources/frame_source';

export interface SourceChoice {
  readonly kind: SourceKind;
  /** The recording to play, when that is what it is. */
  readonly recording: string | null;
  /** The address asked for it; otherwise it is what this device can do. */
  readonly asked: boolean;
}

/**
 * Whether the photographer has to be told that this device's own camera is not what they see: it is
 * a phone, or a tablet, and nobody asked for anything else.
 */
export function isStandIn(choice: SourceChoice, onPhone: boolean): boolean {
  return onPhone && !choice.asked && choice.kind !== 'webxr';
}

/** Raised for an address that asks for what is not there; a sentence. */
export class NoSuchSource extends Error {
  override readonly name = 'NoSuchSource';
}

/**
 * Read `?source=virtual|webxr|replay&recording=NAME`. Without it: the phone's camera where there is
 * augmented reality, else the first recording that the server plays, else the virtual phone.
 */
export function chooseSource(
  query: URLSearchParams, recordings: readonly string[], arSupported: boolean,
): SourceChoice {
  const asked = query.get('source');
  const recording = query.get('recording') ?? recordings[0] ?? null;
  switch (asked) {
    case 'virtual':
    case 'webxr':
      return { kind: asked, recording: null, asked: true };
    case 'replay':
      if (recording === null || !recordings.includes(recording)) {
        const known = recordings.length > 0 ? recordings.join(', ') : 'none';
        throw new NoSuchSource(
          `The server has no recording "${recording ?? ''}" (available: ${known}). `
          + 'Start it with: peaking demo SCENE',
        );
      }
      return { kind: 'replay', recording, asked: true };
    case null:
      if (arSupported) return { kind: 'webxr', recording: null, asked: false };
      if (recording !== null) return { kind: 'replay', recording, asked: false };
      return { kind: 'virtual', recording: null, asked: false };
    default:
      throw new NoSuchSource(`Unknown source "${asked}". Use virtual, webxr or replay.`);
  }
}
