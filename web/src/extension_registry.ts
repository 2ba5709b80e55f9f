/** Which extensions there are, by the parameter of the address that asks for them. */

import type { CaptureExtension, ExtensionModule, ExtensionRequest } from './extension';

/** Loaded only when asked for. */
const EXTENSIONS: Readonly<Record<string, () => Promise<ExtensionModule>>> = {
  study: () => import('./study/capture_study'),
};

/** @returns The extension that the address asks for; null for a capture of one's own. */
export async function openExtension(
  request: Omit<ExtensionRequest, 'value'>,
): Promise<CaptureExtension | null> {
  for (const [parameter, load] of Object.entries(EXTENSIONS)) {
    const value = request.query.get(parameter);
    if (value !== null) return (await load()).open({ ...request, value });
  }
  return null;
}
