/** The gyroscope as a window: the phone is tilted, and one looks a little past the frame. */

/** A tilt of so much is all the way to the side. */
const FULL_DEG = 22;
/** The hand's usual tilt is what it was over about this long. */
const NEUTRAL_MS = 4000;
const SMOOTHING_MS = 80;

/** Safari asks the person first, and only after a touch. */
interface Asking {
  requestPermission?(): Promise<'granted' | 'denied'>;
}

export class Tilt implements Disposable {
  readonly #onLean: (right: number, up: number) => void;
  #stop: AbortController | null = null;
  #last_ms = 0;
  readonly #neutral = { beta: NaN, gamma: NaN };
  readonly #now = { right: 0, up: 0 };

  /** @param onLean Told how far it leans, -1…1 to the right and up. */
  constructor(onLean: (right: number, up: number) => void) {
    this.#onLean = onLean;
  }

  /** Whether this device may have a gyroscope. */
  static get mayWork(): boolean {
    return typeof DeviceOrientationEvent !== 'undefined' && isSecureContext && matchMedia('(pointer: coarse)').matches;
  }

  get on(): boolean {
    return this.#stop !== null;
  }

  /** Begin to follow, to be called in a touch. @returns Whether it is allowed. */
  async start(): Promise<boolean> {
    const asking = DeviceOrientationEvent as unknown as Asking;
    if (asking.requestPermission !== undefined) {
      const answer = await asking.requestPermission().catch(() => 'denied');
      if (answer !== 'granted') return false;
    }
    const stop = new AbortController();
    this.#stop?.abort();
    this.#stop = stop;
    this.#neutral.beta = NaN;
    window.addEventListener('deviceorientation', (event) => this.#follow(event), { signal: stop.signal });
    return true;
  }

  stop(): void {
    this.#stop?.abort();
    this.#stop = null;
    this.#onLean(0, 0);
  }

  [Symbol.dispose](): void {
    this.#stop?.abort();
    this.#stop = null;
  }

  #follow({ beta, gamma, timeStamp }: DeviceOrientationEvent): void {
    if (beta === null || gamma === null) return;
    const step_ms = Math.min(Math.max(timeStamp - this.#last_ms, 0), 1000);
    this.#last_ms = timeStamp;
    const neutral = this.#neutral;
    if (Number.isNaN(neutral.beta)) Object.assign(neutral, { beta, gamma });
    const drift = 1 - Math.exp(-step_ms / NEUTRAL_MS);
    neutral.beta += drift * wrapped(beta - neutral.beta);
    neutral.gamma += drift * wrapped(gamma - neutral.gamma);
    const angle = ((screen.orientation?.angle ?? 0) * Math.PI) / 180;
    const x = wrapped(gamma - neutral.gamma) / FULL_DEG;
    const y = wrapped(beta - neutral.beta) / FULL_DEG;
    const follow = 1 - Math.exp(-step_ms / SMOOTHING_MS);
    this.#now.right += follow * (limited(x * Math.cos(angle) + y * Math.sin(angle)) - this.#now.right);
    this.#now.up += follow * (limited(-x * Math.sin(angle) + y * Math.cos(angle)) - this.#now.up);
    this.#onLean(this.#now.right, -this.#now.up);
  }
}

function wrapped(degrees: number): number {
  return ((degrees + 540) % 360) - 180;
}

function limited(value: number): number {
  return Math.min(Math.max(value, -1), 1);
}
