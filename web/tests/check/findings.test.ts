import { describe, expect, test } from 'vitest';
import { findingsOf, reportOf, verdictOf, whyNoCapture, type Facts } from '../../src/check/findings';

const ANDROID = 'Mozilla/5.0 (Linux; Android 15; Pixel 9) AppleWebKit/537.36 Chrome/147.0 Mobile';
const PHONE: Facts = {
  secure: true, webXr: true, immersiveAr: true, cameraAccess: true, depthSensing: true,
  webGl2: true, maxTextureSize: 8192, workers: true, storage: true, server: true,
  userAgent: ANDROID,
};

function textOf(facts: Facts, title: string): string {
  return findingsOf(facts).find((finding) => finding.title === title)?.text ?? '';
}

describe('verdicts', () => {
  test('Chrome on an ARCore phone is ready', () => {
    expect(verdictOf(PHONE).title).toBe('Ready to capture');
    expect(findingsOf(PHONE).every(({ grade }) => grade === 'good')).toBe(true);
  });

  test('what is missing first is why a device cannot capture', () => {
    expect(whyNoCapture(PHONE)).toBeNull();
    expect(whyNoCapture({ ...PHONE, depthSensing: false })).toBeNull(); // it can, without depth
    expect(whyNoCapture({ ...PHONE, immersiveAr: false })).toContain('Google Play Services for AR');
    expect(whyNoCapture({ ...PHONE, immersiveAr: false, userAgent: 'iPhone' })).toContain('iPhones');
    expect(whyNoCapture({ ...PHONE, secure: false, immersiveAr: false })).toContain('https');
  });

  test('the same phone over plain http is told the https link and the cable', () => {
    const facts = { ...PHONE, secure: false, webXr: false, immersiveAr: false, cameraAccess: false };
    expect(verdictOf(facts).grade).toBe('warn');
    expect(textOf(facts, 'Secure page')).toContain('--adb');
    expect(textOf(facts, 'Augmented reality (WebXR)')).toContain('not secure');
  });

  test('an iPhone is told the truth', () => {
    const facts = {
      ...PHONE, webXr: false, immersiveAr: false, cameraAccess: false, depthSensing: false,
      userAgent: 'Mozilla/5.0 (iPhone; CPU iPhone OS 26_2 like Mac OS X) Version/26.2 Safari/604.1',
    };
    expect(textOf(facts, 'Augmented reality (WebXR)')).toContain('cannot capture here');
    expect(verdictOf(facts).title).toContain('virtual phone');
  });

  test('Android without ARCore, and Firefox on Android', () => {
    const bare = { ...PHONE, immersiveAr: false };
    expect(textOf(bare, 'Augmented reality (WebXR)')).toContain('Google Play Services for AR');
    const firefox = { ...bare, userAgent: 'Mozilla/5.0 (Android 15; Mobile; rv:146.0) Firefox/146.0' };
    expect(textOf(firefox, 'Augmented reality (WebXR)')).toContain('Use Chrome');
  });

  test('a headset without camera pictures cannot capture', () => {
    const quest = { ...PHONE, cameraAccess: false, userAgent: 'OculusBrowser Quest 3 Chrome/146.0' };
    expect(verdictOf(quest).grade).toBe('warn');
  });

  test('a Chrome that is too old for the camera is told which one is needed', () => {
    const old = { ...PHONE, cameraAccess: false, userAgent: ANDROID.replace('147', '120') };
    expect(verdictOf(old).grade).toBe('warn');
    expect(textOf(old, 'Camera access')).toContain('134 or newer');
  });

  test('without a server, or without WebGL 2, nothing works', () => {
    expect(verdictOf({ ...PHONE, server: false }).text).toContain('server');
    expect(verdictOf({ ...PHONE, webGl2: false }).text).toContain('draw');
    expect(verdictOf({ ...PHONE, maxTextureSize: 1024 }).grade).toBe('bad');
  });

  test('a report names every finding and the browser', () => {
    const lines = reportOf({ ...PHONE, storage: false }).split('\n');
    expect(lines).toContain('warn: Storage on this device');
    expect(lines.at(-1)).toBe(ANDROID);
  });
});
