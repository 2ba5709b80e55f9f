/**
 * How something outside the capture page takes part in it: it names the session, sets rules for the
 * controls, and is told of every frame. The page knows this interface, and no extension.
 */

import type { CaptureSession } from './capture/capture_session';
import type { GuideState } from './guidance/guide_session';
import type { LiveView } from './live_view';
import type { Api } from './server/api';
import type { SourceKind } from './sources/frame_source';
import type { HudRules } from './ui/hud_rules';

/** What an extension is opened with. */
export interface ExtensionRequest {
  /** Of the address: what stands behind the extension's own parameter. */
  readonly value: string;
  readonly query: URLSearchParams;
  readonly api: Api;
  readonly source: SourceKind;
}

/** The page, once there is a camera and a session. */
export interface CapturePage {
  readonly live: LiveView;
  readonly session: CaptureSession;
  /** What lies over the picture. */
  readonly overlay: HTMLElement;
}

export interface CaptureExtension extends HudRules {
  /** The capture session that the page is to open. */
  readonly session: { readonly id: string; readonly name: string };
  /** What the photographer is to do; said before the camera starts. */
  readonly task: string;
  /** A guide may draw its marks. */
  readonly showsGuide: boolean;
  /** The page is there. Called once, before the first frame. */
  attach(page: CapturePage): void;
  /** Called when a frame was drawn. @param guide What the guide shows, when there is one. */
  onFrame(guide: GuideState | null): void;
}

/** What the module of an extension exports. */
export interface ExtensionModule {
  /** Never resolves when it leaves the page. */
  open(request: ExtensionRequest): Promise<CaptureExtension>;
}
