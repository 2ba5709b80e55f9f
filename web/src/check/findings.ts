/** From what a browser has to what that means for a photographer. */

/** What was found out without starting a camera. */
export interface Facts {
  readonly secure: boolean;
  readonly webXr: boolean;
  readonly immersiveAr: boolean;
  /** `XRWebGLBinding.getCameraImage` exists. */
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
      text: facts.secure ? 'Browsers show the camera only to pages like this one.'
        : 'This page came over plain http from another machine, where browsers hide the camera. '
          + 'Open the https link that "peaking serve" prints, or use a cable: peaking serve --adb.',
    },
    {
      grade: no('bad', facts.immersiveAr),
      title: 'Augmented reality (WebXR)',
      text: facts.immersiveAr ? 'The browser can tell where the phone is.'
        : whyNoAr(facts, iPhone, android, chrome),
    },
    {
      grade: no(facts.immersiveAr ? 'bad' : 'warn', facts.cameraAccess),
      title: 'Access to the camera picture',
      text: facts.cameraAccess
        ? 'The browser can give pages the picture that belongs to a pose'
          + (facts.immersiveAr ? '; you will be asked.' : ', once it has augmented reality.')
        : 'Only Chrome for Android (107 or newer) gives pages the camera picture of its pose.',
    },
    {
      grade: no('warn', facts.depthSensing),
      title: 'Depth',
      text: facts.depthSensing
        ? 'The browser knows depth sensing, and all its kinds can be read: three formats, in memory '
          + 'or on the graphics card. Whether this device has it shows when the camera runs.'
        : 'Without depth a view is kept and is in the data set, but does not join the picture.',
    },
    {
      grade: no('bad', facts.webGl2 && facts.maxTextureSize >= NEEDED_TEXTURE),
      title: 'WebGL 2',
      text: facts.webGl2
        ? `Textures of up to ${facts.maxTextureSize} texels; ${NEEDED_TEXTURE} are needed.`
        : 'The pictures are drawn with it. Update the browser, or switch hardware acceleration on.',
    },
    {
      grade: no('bad', facts.workers),
      title: 'Work beside the picture',
      text: facts.workers ? 'Photos and planes are decoded without stopping the picture.'
        : 'Workers with OffscreenCanvas are missing. Update the browser.',
    },
    {
      grade: no('warn', facts.storage),
      title: 'Storage on this device',
      text: facts.storage ? 'Photos are safe here until the server has them.'
        : 'Nothing can be kept here (a private window?): do not close the page before all views '
          + 'are sent.',
    },
    {
      grade: no('bad', facts.server),
      title: 'Server',
      text: facts.server ? 'It answers, and this device is paired with it.'
        : 'It does not answer, or this device is not paired: open the link that it printed.',
    },
  ];
}

function whyNoAr(facts: Facts, iPhone: boolean, android: boolean, chrome: boolean): string {
  if (iPhone) {
    return 'Safari and all other browsers on iPhones have no augmented reality for pages, so this '
      + 'page cannot capture here. Record with an app that exports poses and depth, and play the '
      + 'recording: peaking demo SCENE.';
  }
  if (!facts.secure) return 'It is hidden, because the page is not secure (see above).';
  if (android && chrome) {
    return 'Install "Google Play Services for AR" from the Play Store, and see that the phone is in '
      + "Google's list of ARCore devices.";
  }
  if (android) return 'Use Chrome: this browser has no augmented reality for pages.';
  return 'Computers have none. Use the virtual phone here, or open this page on an Android phone.';
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
      text: facts.depthSensing ? 'Start the camera on the first page.'
        : 'But without depth: views are kept, and do not join the picture.',
    };
  }
  return {
    grade: 'warn', title: 'Use the virtual phone, or play a recording',
    text: 'Everything works here but this device\'s own camera.',
  };
}

/** For a bug report. */
export function reportOf(facts: Facts): string {
  const lines = findingsOf(facts).map(({ grade, title }) => `${grade}: ${title}`);
  return [verdictOf(facts).title, ...lines, facts.userAgent].join('\n');
}
