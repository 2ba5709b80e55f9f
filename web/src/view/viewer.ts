/** The viewer of a place: its layers, of which one is shown, and what lies over them. */

import type { Camera } from '../geometry';
import type { ApiError } from '../server/api';
import type { Connection } from '../server/events';
import { button, make, say, show } from '../ui/dom';
import type { Layer, LayerHooks } from './layer';
import type * as lightFieldModule from './light_field_layer';
import type { Place, Shown } from './place';
import { PlaceError, type PlaceSource } from './place_source';
import type * as spaceModule from './space_layer';
import { Strip } from './strip';
import { Tilt } from './tilt';
import './viewer.css';
import { describes, factsText, HOW, NAMES } from './words';

type LightFieldLayer = lightFieldModule.LightFieldLayer;
type SpaceLayer = spaceModule.SpaceLayer;

/** What of the viewer a page has. */
export interface ViewerParts {
  readonly lightField: (() => Promise<typeof lightFieldModule>) | null;
  readonly space: (() => Promise<typeof spaceModule>) | null;
}

export interface ViewerOptions {
  readonly parts: ViewerParts;
  /** Without what takes room: beside something else. */
  readonly compact?: boolean;
  /** Where keys are heard; the window where the viewer is all there is. */
  readonly keysOf?: Window;
  /** What is shown first, in place of what the place asks for. */
  readonly first?: Shown;
  /** More to press, such as training; after the tools. */
  readonly more?: readonly HTMLElement[];
}

/** For tests and benchmarks. */
export interface ViewerInspection {
  readonly shown: Shown | null;
  /** Pictures drawn so far. */
  readonly frames: number;
  readonly asleep: boolean;
  camera(): Camera | null;
  lookFrom(camera: Camera): void;
  lightField(): ReturnType<LightFieldLayer['inspect']>;
  /** Points or Gaussians that are shown. */
  count(): number;
  /** Since the page was asked for. */
  readonly firstPicture_ms: number | null;
  /** MPIs on the graphics card. */
  resident(): { readonly views: number; readonly bytes: number };
}

const ORDER: readonly Shown[] = ['light-field', 'place', 'splat'];
/** More pixels than this per pixel of the page are not seen. */
const MOST_RATIO = 2;
/** What may pass by itself is said for so long. */
const PROBLEM_MS = 20_000;

export class Viewer implements Disposable {
  readonly element: HTMLElement;
  readonly #source: PlaceSource;
  readonly #options: ViewerOptions;
  readonly #screen = make('div', { className: 'place-screen', tabIndex: 0 });
  readonly #border = make('div', { className: 'place-border' });
  readonly #poster = make('img', { className: 'place-poster', alt: '' });
  readonly #title = make('b');
  readonly #facts = make('span', { className: 'quiet' });
  readonly #tabs = make('div', { className: 'place-tabs' });
  readonly #tools = make('div', { className: 'place-tools' });
  readonly #status = make('p', { className: 'place-status' });
  readonly #problem = make('p', { className: 'problem' });
  readonly #foot = make('div', { className: 'place-foot' });
  readonly #help = make('div', { className: 'place-help', hidden: true });
  readonly #strip: Strip;
  readonly #layers = new Map<Shown, Layer>();
  readonly #observer: ResizeObserver;
  readonly #stop = new AbortController();
  #shown: Shown | null = null;
  /** The layer that is being made. */
  #coming: Shown | null = null;
  #chosen = false;
  #scheduled = 0;
  #frames = 0;
  #firstPicture_ms: number | null = null;
  #coverage = false;
  #edge = 0;
  #notice = '';
  /** What there is to say while nothing is shown. */
  #empty = '';
  /** What cannot be shown in this browser. */
  readonly #failed = new Set<Shown>();
  #problemTimer = 0;
  #helpShown = false;

  constructor(element: HTMLElement, source: PlaceSource, options: ViewerOptions) {
    this.element = element;
    this.#source = source;
    this.#options = options;
    this.#strip = new Strip((file) => source.url(file), (view) => this.goTo(view));
    element.classList.add('viewer');
    element.classList.toggle('compact', options.compact === true);
    this.#status.setAttribute('role', 'status');
    this.#problem.setAttribute('role', 'alert');
    this.#problem.hidden = true;
    this.#tabs.setAttribute('role', 'tablist');
    for (const each of [this.#tabs, this.#help, this.#strip.element]) each.dataset['keys'] = 'its own';
    this.#tabs.addEventListener('keydown', (event) => this.#moveAlongTabs(event));
    this.#screen.setAttribute('role', 'application');
    this.#foot.append(this.#status, this.#problem, this.#strip.element, this.#tabs);
    element.replaceChildren(
      this.#screen, this.#poster, this.#border,
      make('div', { className: 'place-title' }, this.#title, this.#facts), this.#tools,
      this.#foot,
      this.#help,
    );
    this.#observer = new ResizeObserver(() => this.#resize());
    this.#observer.observe(element);
    source.subscribe(() => this.#update());
    element.addEventListener('keydown', (event) => {
      if (event.key === 'Escape' && this.#helpShown) this.#showHelp(false);
    }, { signal: this.#stop.signal });
    this.#update();
  }

  get inspection(): ViewerInspection {
    const layer = (): Layer | null => (this.#shown === null ? null : this.#layers.get(this.#shown) ?? null);
    return {
      shown: this.#shown,
      frames: this.#frames,
      asleep: this.#scheduled === 0,
      camera: () => layer()?.camera() ?? null,
      lookFrom: (camera) => layer()?.lookFrom(camera, false),
      lightField: () => this.#lightField?.inspect() ?? null,
      count: () => (this.#shown === 'light-field' ? 0 : this.#space(this.#shown)?.count ?? 0),
      firstPicture_ms: this.#firstPicture_ms,
      resident: () => this.#lightField?.resident ?? { views: 0, bytes: 0 },
    };
  }

  /** Show it so from now on. */
  async show(shown: Shown): Promise<void> {
    this.#chosen = true;
    await this.#show(shown);
  }

  /** What is shown comes from a server: say when that is gone. */
  connected(connection: Connection, refusal: ApiError | null): void {
    if (connection === 'connecting') return;
    this.#notice = connection === 'online' ? '' : refusal?.problem ?? 'Not connected to the server: what you see may be old.';
    this.#sayStatus();
  }

  /** A line under it all: a licence. */
  addLine(text: string): void {
    this.#foot.append(make('p', { className: 'place-line' }, text));
  }

  /** Where this place is to be found by others: a code to scan. @param qr An address of the picture. */
  addAddress(address: string, qr: string | null): void {
    const code = make('a', { className: 'place-address', href: address, title: address });
    if (qr === null) code.append(address);
    else code.append(make('img', { src: qr, alt: `Open ${address} on a phone` }));
    this.element.append(code);
  }

  [Symbol.dispose](): void {
    this.#stop.abort();
    this.#observer.disconnect();
    cancelAnimationFrame(this.#scheduled);
    clearTimeout(this.#problemTimer);
    for (const layer of this.#layers.values()) layer[Symbol.dispose]();
    this.#layers.clear();
    this.#source[Symbol.dispose]();
    this.element.replaceChildren();
  }

  get #lightField(): LightFieldLayer | null {
    return (this.#layers.get('light-field') as LightFieldLayer | undefined) ?? null;
  }

  #space(shown: Shown | null): SpaceLayer | null {
    return shown === 'place' || shown === 'splat' ? this.#layers.get(shown) as SpaceLayer | undefined ?? null : null;
  }

  /** What this place can be shown as. */
  #ways(place: Place): readonly Shown[] {
    const { lightField, space } = this.#options.parts;
    return ORDER.filter((way) => ({
      'light-field': lightField !== null && place.options !== null && place.views.some(({ mpi }) => mpi !== null),
      place: space !== null && place.views.length > 0,
      splat: space !== null && place.splat !== null,
    })[way]);
  }

  #update(): void {
    const { place } = this.#source;
    for (const layer of this.#layers.values()) layer.update(place);
    const ways = this.#ways(place);
    if (place.poster !== null && this.#firstPicture_ms === null && this.#poster.src === '') {
      this.#poster.src = this.#source.url(place.poster);
    }
    show(this.#poster, place.poster !== null && this.#firstPicture_ms === null);
    say(this.#title, place.title);
    this.#strip.update(place.views, place.live);
    this.#drawTabs(ways);
    this.#drawTools(ways);
    this.#sayFacts();
    const wanted = this.#options.first ?? place.shown;
    const able = ways.filter((way) => !this.#failed.has(way));
    const best = able.includes(wanted) ? wanted : able[0] ?? ways[0];
    this.#empty = '';
    const gone = this.#shown !== null && !ways.includes(this.#shown);
    if (best === undefined) {
      this.#empty = place.live ? 'Nothing has been captured yet. It will grow here as views arrive.'
        : 'There is nothing to see in this place.';
    } else if (gone || (this.#coming === null && (this.#shown === null || (!this.#chosen && this.#shown !== best)))) {
      void this.#show(best);
    }
    this.#sayStatus();
    this.#wake();
  }

  #sayStatus(): void {
    const atEdge = this.#edge > 0.85 ? 'This is the edge of what was captured.' : '';
    say(this.#status, this.#empty || this.#notice || atEdge);
  }

  async #show(shown: Shown): Promise<void> {
    if (shown === this.#shown || shown === this.#coming) return;
    this.#coming = shown;
    try {
      const before = this.#shown === null ? null : this.#layers.get(this.#shown) ?? null;
      const layer = this.#layers.get(shown) ?? await this.#made(shown);
      if (this.#stop.signal.aborted) return layer[Symbol.dispose]();
      if (this.#coming !== shown) return;
      this.#fit(layer);
      if (before !== null && shown !== 'place' && this.#shown !== 'place') layer.lookFrom(before.camera(), false);
      if (before !== null) before.active = false;
      layer.active = true;
      this.#shown = shown;
      this.#screen.replaceChildren(layer.canvas);
      this.#screen.setAttribute('aria-label', describes(this.#source.place, shown));
      this.#hooks.onEdge(0);
      this.#resize();
      this.#update();
    } catch (error) {
      this.#failed.add(shown);
      this.#sayProblem(error instanceof Error ? error.message : String(error), true);
    } finally {
      if (this.#coming === shown) this.#coming = null;
    }
  }

  async #made(shown: Shown): Promise<Layer> {
    const { lightField, space } = this.#options.parts;
    const keysOf = this.#options.keysOf ?? this.#screen;
    const { place } = this.#source;
    if (shown === 'light-field') {
      if (lightField === null || place.options === null) throw new PlaceError('This page shows no light fields.');
      const { LightFieldLayer: Made } = await lightField();
      return this.#kept(shown, new Made(this.#source, place.options, this.#hooksOf(shown), keysOf));
    }
    if (space === null) throw new PlaceError('This page shows light fields only.');
    const { SpaceLayer: Made } = await space();
    const layer = new Made(this.#source, this.#hooksOf(shown), { splats: shown === 'splat' }, keysOf);
    const start = place.views[place.start];
    this.#fit(layer);
    if (shown === 'splat' && start !== undefined) layer.lookFrom(start.camera, false);
    return this.#kept(shown, layer);
  }

  #kept(shown: Shown, layer: Layer): Layer {
    this.#layers.set(shown, layer);
    return layer;
  }

  readonly #hooks = {
    onProblem: (problem: string): void => this.#sayProblem(problem, false),
    onEdge: (edge: number): void => {
      if (edge === this.#edge) return;
      this.#edge = edge;
      this.#border.style.opacity = edge.toFixed(2);
      this.#sayStatus();
    },
  };

  /** @param forGood It stays; else it goes when it is not said again. */
  #sayProblem(problem: string, forGood: boolean): void {
    say(this.#problem, problem);
    show(this.#problem, true);
    clearTimeout(this.#problemTimer);
    if (!forGood) this.#problemTimer = window.setTimeout(() => show(this.#problem, false), PROBLEM_MS);
  }

  #hooksOf(shown: Shown): LayerHooks {
    return {
      wake: () => { if (this.#shown === shown) this.#wake(); },
      onProblem: this.#hooks.onProblem,
      onPick: (view) => this.goTo(view),
      onEdge: this.#hooks.onEdge,
      onFirstPicture: () => {
        this.#firstPicture_ms ??= performance.now();
        show(this.#poster, false);
        this.#sayFacts();
      },
    };
  }

  /** Look from where a view was taken; does nothing where it is not there. */
  goTo(view: number): void {
    const camera = this.#source.place.views[view]?.camera;
    if (camera === undefined || this.#shown === null) return;
    this.#strip.current = view;
    this.#layers.get(this.#shown)?.lookFrom(camera, true);
  }

  #wake(): void {
    if (this.#scheduled !== 0 || this.#stop.signal.aborted) return;
    this.#scheduled = requestAnimationFrame(this.#draw);
  }

  readonly #draw = (time_ms: number): void => {
    this.#scheduled = 0;
    const layer = this.#shown === null ? undefined : this.#layers.get(this.#shown);
    if (layer === undefined) return;
    this.#frames += 1;
    if (layer.draw(time_ms)) this.#wake();
  };

  #resize(): void {
    const layer = this.#shown === null ? undefined : this.#layers.get(this.#shown);
    if (layer === undefined) return;
    this.#fit(layer);
    this.#wake();
  }

  #fit(layer: Layer): void {
    const { clientWidth, clientHeight } = this.element;
    if (clientWidth === 0 || clientHeight === 0) return;
    const ratio = Math.min(devicePixelRatio, MOST_RATIO);
    layer.resize(Math.round(clientWidth * ratio), Math.round(clientHeight * ratio), ratio);
  }

  #sayFacts(): void {
    say(this.#facts, factsText(this.#source.place, this.#space('place')?.size() ?? null));
  }

  #drawTabs(ways: readonly Shown[]): void {
    show(this.#tabs, ways.length > 1);
    const made = ways.map((way) => {
      const tab = make('button', { type: 'button', onclick: () => void this.show(way) }, NAMES[way]);
      tab.setAttribute('role', 'tab');
      tab.setAttribute('aria-selected', String(way === this.#shown));
      return tab;
    });
    const key = JSON.stringify([ways, this.#shown]);
    if (this.#tabs.dataset['drawn'] === key) return;
    this.#tabs.dataset['drawn'] = key;
    const focused = this.#tabs.contains(document.activeElement);
    this.#tabs.replaceChildren(...made);
    if (focused) this.#tabs.querySelector<HTMLElement>('[aria-selected="true"]')?.focus();
  }

  /** Arrows go from one to the next, as everywhere. */
  #moveAlongTabs({ key }: KeyboardEvent): void {
    const by = key === 'ArrowRight' ? 1 : key === 'ArrowLeft' ? -1 : 0;
    const tabs = Array.from(this.#tabs.querySelectorAll('button'));
    const at = tabs.findIndex((tab) => tab === document.activeElement);
    if (by !== 0 && at >= 0) tabs[(at + by + tabs.length) % tabs.length]?.focus();
  }

  #drawTools(ways: readonly Shown[]): void {
    const key = JSON.stringify([ways, this.#shown, this.#source.place.points.length > 1]);
    if (this.#tools.dataset['drawn'] === key) return;
    this.#tools.dataset['drawn'] = key;
    const tools: HTMLElement[] = [];
    if (this.#shown === 'place') {
      tools.push(button('', '⌂', 'See all of it', () => {
        this.#space('place')?.overview();
        this.#wake();
      }));
      if (this.#source.place.points.length > 1) tools.push(this.#coverageTool());
    }
    if (this.#shown === 'light-field' && Tilt.mayWork) tools.push(this.#tiltTool());
    if (this.#options.compact !== true) tools.push(button('', '?', 'Help', () => this.#showHelp(!this.#helpShown)));
    this.#tools.replaceChildren(...tools, ...this.#options.more ?? []);
  }

  #coverageTool(): HTMLElement {
    const tool = button('', 'Coverage', 'Colour what one view sees amber, what three or more see green', () => {
      this.#coverage = !this.#coverage;
      tool.setAttribute('aria-pressed', String(this.#coverage));
      const layer = this.#space('place');
      if (layer !== null) layer.byCoverage = this.#coverage;
    });
    tool.setAttribute('aria-pressed', String(this.#coverage));
    return tool;
  }

  #tiltTool(): HTMLElement {
    const tool = button('', 'Tilt', 'Tilt the phone to look around the corner', () => {
      const tilt = this.#lightField?.tilt;
      if (tilt === undefined) return;
      if (tilt.on) {
        tilt.stop();
        tool.setAttribute('aria-pressed', 'false');
      } else {
        void tilt.start().then((allowed) => {
          tool.setAttribute('aria-pressed', String(allowed));
          if (!allowed) this.#hooks.onProblem('This browser does not let pages read how the phone is tilted.');
        });
      }
    });
    tool.setAttribute('aria-pressed', String(this.#lightField?.tilt.on === true));
    return tool;
  }

  #showHelp(visible: boolean): void {
    if (visible && this.#shown !== null) {
      this.#help.replaceChildren(
        make('h2', {}, NAMES[this.#shown]), make('p', {}, HOW[this.#shown]),
        make('p', { className: 'quiet' }, describes(this.#source.place, this.#shown).replace(HOW[this.#shown], '')),
        button('', 'Close', 'Close the help', () => this.#showHelp(false)),
      );
    }
    this.#helpShown = visible;
    show(this.#help, visible);
    if (visible) this.#help.querySelector('button')?.focus();
  }
}
