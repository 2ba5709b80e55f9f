/** The self-test page: /check. */

import { Api } from '../server/api';
import { webXrSource } from '../sources/webxr';
import { make } from '../ui/dom';
import { findingsOf, reportOf, verdictOf, type Finding } from './findings';
import { probe } from './probe';
import { tracePanel } from './trace_panel';

const SIGNS = { good: '✓', warn: '!', bad: '✕' } as const;
/** How long the camera is tried. */
const TRIAL_MS = 6000;

/** Run the real camera for some seconds, and say what it gave. */
async function tryCamera(out: HTMLElement): Promise<void> {
  const canvas = make('canvas');
  const gl = canvas.getContext('webgl2', { xrCompatible: true });
  if (gl === null) return;
  const stop = new AbortController();
  let frames = 0;
  let withDepth = 0;
  let tracked = 0;
  let picture = 'none';
  let depth = 'none';
  setTimeout(() => stop.abort(), TRIAL_MS);
  try {
    await webXrSource({ overlay: null }).run(gl, (frame) => {
      frames += 1;
      if (frame.camera === null) return;
      tracked += 1;
      picture = `${frame.camera.pinhole.width_px} × ${frame.camera.pinhole.height_px}`;
      const map = frame.depth();
      if (map === null) return;
      withDepth += 1;
      depth = `${map.width_px} × ${map.height_px}`;
    }, stop.signal);
    out.textContent = `${frames} frames in ${TRIAL_MS / 1000} s, ${tracked} of them tracked. Camera `
      + `picture: ${picture}. Depth in ${withDepth} frames: ${depth}.`;
  } catch (error) {
    out.textContent = error instanceof Error ? error.message : String(error);
  }
}

async function main(): Promise<void> {
  const query = new URLSearchParams(location.search);
  const facts = await probe(new Api());
  const verdict = verdictOf(facts);
  const trial = make('p', { className: 'quiet', role: 'status' });
  const copy = make('button', { type: 'button' }, 'Copy as text');
  copy.onclick = () => void navigator.clipboard.writeText(reportOf(facts)).then(
    () => { copy.textContent = 'Copied'; },
    () => { trial.textContent = reportOf(facts); }, // then it can be copied by hand
  );
  const camera = make('button', { className: 'primary', type: 'button' }, 'Try the camera');
  camera.onclick = () => void tryCamera(trial);
  camera.hidden = !facts.immersiveAr;
  document.getElementById('check')?.replaceChildren(
    make('div', { className: `verdict ${verdict.grade}` }, verdict.title,
      make('small', {}, verdict.text)),
    make('div', { className: 'row' }, camera,
      ...(verdict.grade === 'bad' ? []
        : [make('a', { className: 'button', href: './?source=virtual' }, 'Virtual phone')]), copy),
    trial,
    ...missingFirst(findingsOf(facts)).map(({ grade, title, text }) =>
      make('div', { className: `finding ${grade}` }, make('i', {}, SIGNS[grade]),
        make('b', {}, title), make('p', {}, text))),
    ...(facts.immersiveAr || query.get('source') === 'virtual' ? [tracePanel(facts, query)] : []),
  );
}

function missingFirst(findings: readonly Finding[]): Finding[] {
  const order = { bad: 0, warn: 1, good: 2 } as const;
  return [...findings].sort((a, b) => order[a.grade] - order[b.grade]);
}

void main();
