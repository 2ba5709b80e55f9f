/** From what a browser has to what that means for a photographer. */

/** What was found out without starting a camera. */
export interface Facts {
  readonly secure: boolean;
  readonly webXr: boolean;
  readonly immersiveAr: boolean;
  /** `XRWebGLBinding.getCameraImage` exists, and `Symbol.dispose`, which releases its frames. */
  readonly cameraAccess: boolean;
  readonly depthSensing: boolean;
  readonly webGl2: boolean;
  readonly maxTextureSize: number;
  readonly workers: boolean;
  readonly storage: boolean;
  readonly server: boolean;
  readonly userAgent: string;
}

export type Grade = 'good' | 'warn' | 'bad';

export interface Finding {
  readonly grade: Grade;
  readonly title: string;
  /** What it means, and what to do when it is missing. */
  readonly text: string;
}

export interface Verdict {
  readonly grade: Grade;
  readonly title: string;
  readonly text: string;
}

/** The texture that holds the tiles of one view is this wide. */
const NEEDED_TEXTURE = 2048;

export function findingsOf(facts: Facts): Finding[] {
  const iPhone = /iPhone|iPad/.test(facts.userAgent);
  const android = facts.userAgent.includes('Android');
  const chrome = /Chrome\//.test(facts.userAgent) && !/Firefox/.test(facts.userAgent);
  const no = (grade: Grade, has: boolean): Grade => (has ? 'good' : grade);
  return [
    {
      grade: no('bad', facts.secure),
      title: 'Secure page',
      text: facts.secure ? 'The page is secure, which browsers require for camera access.'
        : 'This page was loaded over plain http, where browsers block the camera. Open the https '
          + 'link that "peaking serve" prints, or use a USB cable: peaking serve --adb.',
    },
    {
      grade: no('bad', facts.immersiveAr),
      title: 'Augmented reality (WebXR)',
      text: facts.immersiveAr ? 'The browser can track the position of the phone.'
        : whyNoAr(facts, iPhone, android, chrome),
    },
    {
      grade: no(facts.immersiveAr ? 'bad' : 'warn', facts.cameraAccess),
      title: 'Camera access',
      text: facts.cameraAccess
        ? 'The browser can give pages the camera picture'
          + (facts.immersiveAr ? '; it asks for permission first.' : ' on devices with augmented reality.')
        : 'Only Chrome for Android gives pages the camera picture. Use version 134 or newer.',
    },
    {
      grade: no('warn', facts.depthSensing),
      title: 'Depth',
      text: facts.depthSensing
        ? 'The browser supports depth sensing. Whether this device does is known once the camera '
          + 'runs.'
        : 'Without depth, views are saved and are part of the data set, but the live picture does '
          + 'not use them.',
    },
    {
      grade: no('bad', facts.webGl2 && facts.maxTextureSize >= NEEDED_TEXTURE),
      title: 'WebGL 2',
      text: facts.webGl2
        ? `Textures of up to ${facts.maxTextureSize} texels (${NEEDED_TEXTURE} are needed).`
        : 'WebGL 2 draws the pictures. Update the browser, or turn on hardware acceleration.',
    },
    {
      grade: no('bad', facts.workers),
      title: 'Background work',
      text: facts.workers ? 'Photos are encoded and planes decoded in the background.'
        : 'This browser has no workers with OffscreenCanvas. Update it.',
    },
    {
      grade: no('warn', facts.storage),
      title: 'Storage on this device',
      text: facts.storage ? 'Photos are kept here until the server has them.'
        : 'Nothing can be saved here (a private window?). Do not close the page before all views '
          + 'are uploaded.',
    },
    {
      grade: no('bad', facts.server),
      title: 'Server',
      text: facts.server ? 'The server answers, and this device is paired with it.'
        : 'The server does not answer, or this device is not paired. Open the link that it printed.',
    },
  ];
}

function whyNoAr(facts: Facts, iPhone: boolean, android: boolean, chrome: boolean): string {
  if (iPhone) {
    return 'Browsers on iPhones and iPads do not offer augmented reality to pages, so this page '
      + 'cannot capture here. Record with an app that exports poses and depth, then play the '
      + 'recording: peaking demo SCENE.';
  }
  if (!facts.secure) return 'Not available, because the page is not secure (see above).';
  if (android && chrome) {
    return 'Install "Google Play Services for AR" from the Play Store, and check that the phone is on '
      + "Google's list of ARCore devices.";
  }
  if (android) return 'Use Chrome. This browser does not offer augmented reality to pages.';
  return 'Computers do not have it. Use the virtual phone, or open this page on an Android phone.';
}

/** Why this device's own camera cannot be used: the first thing that is missing; null when it can. */
export function whyNoCapture(facts: Facts): string | null {
  if (verdictOf(facts).grade === 'good') return null;
  return findingsOf(facts).find(({ grade }) => grade === 'bad')?.text ?? null;
}

export function verdictOf(facts: Facts): Verdict {
  const draws = facts.webGl2 && facts.maxTextureSize >= NEEDED_TEXTURE && facts.workers;
  if (!draws || !facts.server) {
    return {
      grade: 'bad', title: 'Not ready',
      text: facts.server ? 'This browser cannot draw the pictures.' : 'The server does not answer.',
    };
  }
  if (facts.secure && facts.immersiveAr && facts.cameraAccess) {
    return {
      grade: 'good', title: 'Ready to capture',
      text: facts.depthSensing ? 'Start the camera on the capture page.'
        : 'But without depth: views are saved, but the live picture does not use them.',
    };
  }
  return {
    grade: 'warn', title: 'Use the virtual phone, or play a recording',
    text: "Everything works here except this device's own camera.",
  };
}

/** For a bug report. */
export function reportOf(facts: Facts): string {
  const lines = findingsOf(facts).map(({ grade, title }) => `${grade}: ${title}`);
  return [verdictOf(facts).title, ...lines, facts.userAgent].join('\n');
}
