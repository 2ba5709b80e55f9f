/** Which key does what, as a value. */

import type { Overlay } from '../render/view_renderer';

export type KeyAction =
  | { readonly kind: 'shoot' | 'undo' | 'finish' | 'help' | 'close' }
  | { readonly kind: 'look'; readonly overlay: Overlay }
  | { readonly kind: 'step'; readonly frames: number };

/** The part of a `KeyboardEvent` that counts. */
export interface PressedKey {
  readonly key: string;
  readonly repeat: boolean;
  readonly altKey: boolean;
  readonly metaKey: boolean;
  readonly ctrlKey: boolean;
}

/**
 * Null when the key is not for us: the browser's own shortcuts, and what is typed into a field.
 *
 * @param typing Whether a field for text has the focus.
 * @param pressing Whether something has the focus that space presses: that is then what it does.
 */
export function actionOfKey(pressed: PressedKey, typing: boolean, pressing = false): KeyAction | null {
  const { key, repeat, altKey, metaKey, ctrlKey } = pressed;
  if (key === 'Escape') return { kind: 'close' };
  if (pressing && key === ' ') return null;
  if (typing || repeat || altKey || metaKey) return null;
  if (ctrlKey) return key === 'z' ? { kind: 'undo' } : null;
  switch (key) {
    case ' ': case 'AudioVolumeUp': case 'VolumeUp': return { kind: 'shoot' };
    case 'z': case 'Z': return { kind: 'undo' };
    case '1': return { kind: 'look', overlay: 'mpi' };
    case '2': return { kind: 'look', overlay: 'video' };
    case '3': return { kind: 'look', overlay: 'peaks' };
    case 'f': case 'F': return { kind: 'finish' };
    case '?': return { kind: 'help' };
    case ',': return { kind: 'step', frames: -1 };
    case '.': return { kind: 'step', frames: 1 };
    default: return null;
  }
}
