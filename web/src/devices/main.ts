/** The page /devices: who may take photos here, and how another phone joins. */

import { Api, ApiError } from '../server/api';
import { make } from '../ui/dom';
import type { PairedDevice } from '../wire';

const LOOK_EVERY_MS = 5000;
const NEW_CODE_EVERY_MS = 5 * 60_000;
const ROLES = {
  device: '', participant: 'A participant\u2019s phone', console: 'The experimenter\u2019s browser',
} as const;

const api = new Api();
let codeTimer = 0;

async function main(): Promise<void> {
  await api.pairFromHash();
  elementOf('add').onclick = () => void guarded(showCode);
  for (;;) {
    await guarded(list);
    await new Promise((resolve) => setTimeout(resolve, LOOK_EVERY_MS));
  }
}

async function list(): Promise<void> {
  const { devices, open } = await api.devices();
  elementOf('add').hidden = open;
  elementOf('open').hidden = !open;
  elementOf('devices').replaceChildren(...devices.map(lineOf));
  say('');
}

function lineOf(device: PairedDevice): HTMLElement {
  const revoke = make('button', { type: 'button' }, 'Revoke');
  revoke.ariaLabel = `Revoke ${device.name}`;
  revoke.onclick = () => {
    const sure = confirm(device.this
      ? 'This is the device in front of you. It will need a new code to come back. Revoke it?'
      : `${device.name} will need a new code to come back. Photos that it has not sent yet wait on `
        + 'it until then. Revoke it?');
    if (sure) void guarded(() => api.revoke(device.id).then(list));
  };
  const whose = device.participants.length > 0 ? ` (${device.participants.join(', ')})` : '';
  const role = ROLES[device.role] === '' ? [] : [`${ROLES[device.role]}${whose}`];
  return make('li', { className: 'device' },
    make('b', {}, device.name),
    make('span', { className: 'quiet' }, [
      ...(device.this ? ['This device'] : []), ...role,
      `last seen ${timeOf(device.seen_s)}`, `paired ${timeOf(device.paired_s)}`,
    ].join(' · ')),
    revoke);
}

/** A code ends after ten minutes; while it is shown, a fresh one takes its place before. */
async function showCode(): Promise<void> {
  clearTimeout(codeTimer);
  const { links, qr_svg } = await api.pairingLink();
  elementOf('code').replaceChildren(
    make('img', {
      src: `data:image/svg+xml,${encodeURIComponent(qr_svg)}`, width: 260, height: 260,
      alt: 'QR code for one more device',
    }),
    make('p', {}, 'Scan this with the camera of the other phone. It lets in one device; for a '
      + 'third, ask for another code.'),
    ...links.slice(0, 1).map((link) => make('p', { className: 'quiet link' }, link)));
  codeTimer = window.setTimeout(() => void guarded(showCode), NEW_CODE_EVERY_MS);
}

async function guarded(work: () => Promise<void>): Promise<void> {
  try {
    await work();
  } catch (error) {
    if (error instanceof ApiError && (error.status === 401 || error.status === 403)) {
      elementOf('devices').replaceChildren();
      elementOf('code').replaceChildren();
    }
    say(error instanceof ApiError ? error.problem : String(error));
  }
}

function timeOf(time_s: number): string {
  return new Date(1000 * time_s).toLocaleString([], { dateStyle: 'short', timeStyle: 'short' });
}

function say(said: string): void {
  elementOf('problem').textContent = said;
}

function elementOf(id: string): HTMLElement {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`the page has no element #${id}`);
  return element;
}

main().catch((error: unknown) => say(error instanceof Error ? error.message : String(error)));
