/** What we ask of the platform, as a value. */

/** Options of `requestSession('immersive-ar', …)`. */
export function sessionInit(overlay: Element | null): XRSessionInit {
  const init: XRSessionInit = {
    requiredFeatures: ['camera-access', 'local'],
    optionalFeatures: ['depth-sensing', ...(overlay === null ? [] : ['dom-overlay'])],
    // Without this the feature is refused, also as an optional one. Chrome on phones gives the first
    // two formats to the CPU; headsets the third, and some of them as a texture only.
    depthSensing: {
      usagePreference: ['cpu-optimized', 'gpu-optimized'],
      dataFormatPreference: ['luminance-alpha', 'unsigned-short', 'float32'],
    },
  } as XRSessionInit;
  return overlay === null ? init : { ...init, domOverlay: { root: overlay } };
}
