/** What the controls over the picture may do. */

/** Read at every frame, so each of them may change at any time. */
export interface HudRules {
  /** Whether anything red, or about red, may be seen. */
  readonly showsRed: boolean;
  /** The coach, its help and the settings are offered. */
  readonly offersHelp: boolean;
  /** Views may be taken, and taken back. */
  readonly mayShoot: boolean;
  /** The shutter does something. */
  readonly mayPress: boolean;
  /** Something lies over the picture: keys are not for the controls. */
  readonly covered: boolean;
  /** What the button says that ends the session; null: its usual word. */
  readonly finishLabel: string | null;
  /** What that button does; null: it opens the page's own sheet. */
  readonly finish: (() => void) | null;
}

/** A capture of one's own. */
export const UNRESTRICTED: HudRules = {
  showsRed: true, offersHelp: true, mayShoot: true, mayPress: true, covered: false,
  finishLabel: null, finish: null,
};
