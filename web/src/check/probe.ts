/** Finds out what this browser has, without starting a camera. */

import type { Api } from '../server/api';
import type { Facts } from './findings';

export async function probe(api: Api): Promise<Facts> {
  const gl = document.createElement('canvas').getContext('webgl2');
  await api.pairFromHash().catch(() => false);
  const binding = (globalThis as { XRWebGLBinding?: { prototype: object } }).XRWebGLBinding;
  return {
    secure: globalThis.isSecureContext,
    webXr: navigator.xr !== undefined,
    immersiveAr: (await navigator.xr?.isSessionSupported('immersive-ar').catch(() => false)) ?? false,
    cameraAccess: binding !== undefined && 'getCameraImage' in binding.prototype
      && 'dispose' in Symbol,
    depthSensing: 'XRDepthInformation' in globalThis || 'XRCPUDepthInformation' in globalThis,
    webGl2: gl !== null,
    maxTextureSize: gl === null ? 0 : Number(gl.getParameter(gl.MAX_TEXTURE_SIZE)),
    workers: 'Worker' in globalThis && 'OffscreenCanvas' in globalThis,
    storage: await canStore(),
    server: await api.server().then(() => true, () => false),
    userAgent: navigator.userAgent,
  };
}

function canStore(): Promise<boolean> {
  return new Promise((resolve) => {
    try {
      const request = indexedDB.open('peaking-check', 1);
      request.onsuccess = () => {
        request.result.close();
        indexedDB.deleteDatabase('peaking-check');
        resolve(true);
      };
      request.onerror = () => resolve(false);
    } catch {
      resolve(false);
    }
  });
}
