/** Mouse, touch and keys by which one walks and looks around, whatever it is that walks. */

/** What is moved. */
export interface Walker {
  /** Level but for `up_m`, along where it looks. */
  walk(right_m: number, up_m: number, ahead_m: number): void;
  /** To the left, and up. */
  turn(yaw_rad: number, pitch_rad: number): void;
}

/** What a key does: walk right, up, ahead; turn left, up. Each -1, 0 or 1. */
type Key = readonly [right: number, up: number, ahead: number, left: number, pitch: number];

const WALKING: Readonly<Record<string, Key>> = {
  KeyW: [0, 0, 1, 0, 0], KeyS: [0, 0, -1, 0, 0], KeyA: [-1, 0, 0, 0, 0], KeyD: [1, 0, 0, 0, 0],
  KeyE: [0, 1, 0, 0, 0], KeyQ: [0, -1, 0, 0, 0],
};
/** Arrows walk: a phone is turned by dragging. */
export const ARROWS_WALK: Readonly<Record<string, Key>> = {
  ...WALKING,
  ArrowUp: [0, 0, 1, 0, 0], ArrowDown: [0, 0, -1, 0, 0], ArrowLeft: [-1, 0, 0, 0, 0], ArrowRight: [1, 0, 0, 0, 0],
};
/** Arrows look around: all can be done by keys alone. */
export const ARROWS_LOOK: Readonly<Record<string, Key>> = {
  ...WALKING,
  ArrowUp: [0, 0, 0, 0, 1], ArrowDown: [0, 0, 0, 0, -1], ArrowLeft: [0, 0, 0, 1, 0], ArrowRight: [0, 0, 0, -1, 0],
};

/** Its numbers may change while it is used. */
export interface WalkOptions {
  readonly keys: Readonly<Record<string, Key>>;
  readonly walk_m_per_s: number;
  readonly drag_rad_per_px: number;
  readonly wheel_m_per_px: number;
  readonly pinch_m_per_px: number;
}

const TURN_RAD_PER_S = 0.9;
/** Speeds follow the keys with this time constant, as an arm does. */
const INERTIA_MS = 120;
const AT_REST = 1e-3;

export class WalkControls {
  /** Keys are heard. */
  enabled = true;
  /** Something was asked for: whoever draws on demand draws. */
  onInput: (() => void) | null = null;
  readonly #walker: Walker;
  readonly #options: WalkOptions;
  readonly #held = new Set<string>();
  readonly #pointers = new Map<number, { x: number; y: number }>();
  readonly #speeds = new Float64Array(5);
  #spreadBefore_px = 0;

  constructor(walker: Walker, options: WalkOptions) {
    this.#walker = walker;
    this.#options = options;
  }

  /** Whether it moves, or a key that moves it is held. */
  get moving(): boolean {
    if (this.#held.size > 0) return true;
    for (let axis = 0; axis < 5; axis += 1) if (this.#speeds[axis] !== 0) return true;
    return false;
  }

  /**
   * Listen until the signal aborts.
   *
   * @param keysOf Where keys are heard; the window, or what has the focus.
   */
  attach(element: HTMLElement, signal: AbortSignal, keysOf: Window | HTMLElement = window): void {
    this.attachKeys(keysOf, signal);
    const options = { signal };
    element.style.touchAction = 'none';
    element.addEventListener('pointerdown', (event) => {
      this.#pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      this.#spreadBefore_px = this.#spread_px();
      element.setPointerCapture(event.pointerId);
    }, options);
    element.addEventListener('pointermove', (event) => this.#drag(event), options);
    for (const name of ['pointerup', 'pointercancel'] as const) {
      element.addEventListener(name, (event) => {
        this.#pointers.delete(event.pointerId);
        this.#spreadBefore_px = this.#spread_px();
      }, options);
    }
    element.addEventListener('wheel', (event) => {
      event.preventDefault();
      this.#walker.walk(0, 0, -event.deltaY * this.#options.wheel_m_per_px);
      this.onInput?.();
    }, { signal, passive: false });
  }

  /** Listen to keys alone until the signal aborts. */
  attachKeys(keysOf: Window | HTMLElement, signal: AbortSignal): void {
    const options = { signal };
    const onKey = (event: Event): void => {
      if (!(event instanceof KeyboardEvent)) return;
      if (!this.enabled || event.ctrlKey || event.metaKey || event.altKey || hasKeysOfItsOwn(event.target)) return;
      if (!(event.code in this.#options.keys)) return;
      this.#held.add(event.code);
      event.preventDefault();
      this.onInput?.();
    };
    keysOf.addEventListener('keydown', onKey, options);
    window.addEventListener('keyup', (event) => this.#held.delete(event.code), options);
    window.addEventListener('blur', () => this.#held.clear(), options);
  }

  /** Let time pass. */
  advance(step_ms: number): void {
    const keep = Math.exp(-step_ms / INERTIA_MS);
    for (let axis = 0; axis < 5; axis += 1) this.#speeds[axis] = this.#towards(axis, keep);
    const step_m = (this.#options.walk_m_per_s * step_ms) / 1000;
    const step_rad = (TURN_RAD_PER_S * step_ms) / 1000;
    // Taken apart one by one: at every frame nothing is made.
    const right = this.#speeds[0] ?? 0;
    const up = this.#speeds[1] ?? 0;
    const ahead = this.#speeds[2] ?? 0;
    const left = this.#speeds[3] ?? 0;
    const pitch = this.#speeds[4] ?? 0;
    if (right !== 0 || up !== 0 || ahead !== 0) this.#walker.walk(right * step_m, up * step_m, ahead * step_m);
    if (left !== 0 || pitch !== 0) this.#walker.turn(left * step_rad, pitch * step_rad);
  }

  /** The speed along one axis of the keys, a moment later. */
  #towards(axis: number, keep: number): number {
    let aim = 0;
    for (const code of this.#held) aim += this.#options.keys[code]?.[axis] ?? 0;
    const next = keep * (this.#speeds[axis] ?? 0) + (1 - keep) * aim;
    return Math.abs(next) < AT_REST ? 0 : next;
  }

  #drag(event: PointerEvent): void {
    const last = this.#pointers.get(event.pointerId);
    if (last === undefined) return;
    const dx = event.clientX - last.x;
    const dy = event.clientY - last.y;
    last.x = event.clientX;
    last.y = event.clientY;
    const { pinch_m_per_px, drag_rad_per_px } = this.#options;
    if (this.#pointers.size > 1) {
      // Two fingers carry it; each of them brings half. Apart, they bring the scene closer.
      const spread_px = this.#spread_px();
      const ahead_m = (spread_px - this.#spreadBefore_px) * pinch_m_per_px;
      this.#spreadBefore_px = spread_px;
      this.#walker.walk((-dx * pinch_m_per_px) / 2, (dy * pinch_m_per_px) / 2, ahead_m);
    } else {
      // The picture is dragged: what is under the finger stays there.
      this.#walker.turn(dx * drag_rad_per_px, dy * drag_rad_per_px);
    }
    this.onInput?.();
  }

  /** How far the first two fingers are apart; 0 when there are not two. */
  #spread_px(): number {
    const [a, b] = this.#pointers.values();
    return a === undefined || b === undefined ? 0 : Math.hypot(a.x - b.x, a.y - b.y);
  }
}

/** Where keys write, or scroll: marked by `data-keys`. */
function hasKeysOfItsOwn(target: EventTarget | null): boolean {
  return target instanceof HTMLElement && target.closest('input, textarea, select, [data-keys]') !== null;
}
