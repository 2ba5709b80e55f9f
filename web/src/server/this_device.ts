/** What this browser calls itself when it is paired. */

export interface ThisDevice {
  /** Made once, so that a code that is shown again after a lost answer is known to be its own. */
  readonly id: string;
  readonly name: string;
}

const KEY = 'peaking-device';

export function thisDevice(): ThisDevice {
  return { id: keptId(), name: deviceName(navigator.userAgent) };
}

function keptId(): string {
  const made = crypto.randomUUID();
  try {
    const kept = localStorage.getItem(KEY);
    if (kept !== null && /^[0-9a-f-]{36}$/.test(kept)) return kept;
    localStorage.setItem(KEY, made);
  } catch { /* a private window keeps nothing: then it is another device each time */ }
  return made;
}

/** In words that its owner knows: "Chrome on Pixel 9". */
export function deviceName(agent: string): string {
  const model = /Android[^;)]*; ([^;)]+?)(?: Build\/[^;)]*)?[;)]/.exec(agent)?.[1];
  const system = model !== undefined && model !== 'K' ? model : systemOf(agent);
  return `${browserOf(agent)} on ${system}`;
}

function systemOf(agent: string): string {
  const systems = [
    ['Android', 'an Android phone'], ['iPhone', 'an iPhone'], ['iPad', 'an iPad'],
    ['CrOS', 'a Chromebook'], ['Windows', 'a Windows computer'], ['Macintosh', 'a Mac'],
    ['Linux', 'a Linux computer'],
  ] as const;
  return systems.find(([mark]) => agent.includes(mark))?.[1] ?? 'another device';
}

function browserOf(agent: string): string {
  const browsers = [
    ['Edg', 'Edge'], ['OPR/', 'Opera'], ['SamsungBrowser', 'Samsung Internet'],
    ['Firefox', 'Firefox'], ['Chrome', 'Chrome'], ['Safari', 'Safari'],
  ] as const;
  return browsers.find(([mark]) => agent.includes(mark))?.[1] ?? 'A browser';
}
