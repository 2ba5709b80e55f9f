/** The cameras of a place as frusta with their pictures, and the path from one to the next. */

import {
  BufferGeometry, DoubleSide, Float32BufferAttribute, Group, LineBasicMaterial, LineDashedMaterial, LineSegments, Line,
  Mesh, MeshBasicMaterial, SRGBColorSpace, TextureLoader, type Texture,
} from 'three';
import { positionOf, type Camera, type Vector3 } from '../geometry';
import type { PlaceView, Suggested } from './place';

const READY = 0x5bd68a;
const WAITING = 0x7ab8ff;
const SUGGESTED = 0xffffff;
/** More pictures than this are not shown in the room: their frames are. */
const MOST_PICTURES = 160;

const corners = [[0, 0], [1, 0], [1, 1], [0, 1]] as const;

/** The corners of a picture in the world, at a depth: top left, top right, bottom right, bottom left. */
export function cornersOf({ pinhole: k, worldFromCam: { rows: m } }: Camera, depth: number): Vector3[] {
  return corners.map(([right, down]) => {
    const x = (depth * (right * k.width_px - k.cx_px)) / k.fx_px;
    const y = (depth * (down * k.height_px - k.cy_px)) / k.fy_px;
    const at = (r: number): number =>
      (m[4 * r] ?? 0) * x + (m[4 * r + 1] ?? 0) * y + (m[4 * r + 2] ?? 0) * depth + (m[4 * r + 3] ?? 0);
    return [at(0), at(1), at(2)];
  });
}

export class Frusta implements Disposable {
  readonly group = new Group();
  /** Something came that is to be drawn. */
  readonly #wake: () => void;
  readonly #urlOf: (file: string) => string;
  readonly #onProblem: (problem: string) => void;
  readonly #loader = new TextureLoader();
  readonly #textures = new Map<string, Texture>();
  /** Who waits for a texture that is on its way. */
  readonly #waiting = new Map<string, (() => void)[]>();
  #views: readonly PlaceView[] = [];
  #suggested: readonly Suggested[] = [];
  #size = 0;
  /** The view through which it is looked: its photo stands before the camera. */
  #through: Mesh<BufferGeometry, MeshBasicMaterial> | null = null;

  constructor(urlOf: (file: string) => string, wake: () => void, onProblem: (problem: string) => void) {
    this.#urlOf = urlOf;
    this.#wake = wake;
    this.#onProblem = onProblem;
  }

  /** Draw these from now on. @param size How deep a frustum is. */
  update(views: readonly PlaceView[], suggested: readonly Suggested[], size: number): void {
    if (size === this.#size && areSame(views, this.#views) && areSame(suggested, this.#suggested)) return;
    this.#views = views;
    this.#suggested = suggested;
    this.#size = size;
    this.#clear();
    this.#forgetTextures(new Set(views.map(({ thumbnail }) => thumbnail)));
    const of = (ready: boolean): Camera[] =>
      views.filter(({ mpi, thumbnail }) => ((mpi ?? thumbnail) !== null) === ready).map(({ camera }) => camera);
    this.group.add(lines(of(true), size, new LineBasicMaterial({ color: READY })));
    this.group.add(lines(of(false), size, new LineBasicMaterial({ color: WAITING })));
    const dashed = lines(suggested.map(({ camera }) => camera), size, new LineDashedMaterial({
      color: SUGGESTED, dashSize: size / 6, gapSize: size / 8,
    }));
    this.group.add(dashed.computeLineDistances());
    this.group.add(pathOf(views));
    for (const { camera, thumbnail } of views.slice(0, MOST_PICTURES)) {
      if (thumbnail !== null) this.group.add(this.#picture(camera, thumbnail, size));
    }
  }

  /** Show the photo of a view before the camera, or none. */
  lookThrough(index: number | null): void {
    this.#forgetThrough();
    const view = index === null ? undefined : this.#views[index];
    const photo = view?.photo ?? view?.thumbnail ?? null;
    this.group.visible = photo === null;
    if (view === undefined || photo === null) return;
    this.#through = this.#picture(view.camera, photo, this.#size);
    this.#through.material.depthTest = false;
    this.#through.renderOrder = 1;
  }

  /** The photo that stands before the camera; not part of the group. */
  get through(): Mesh | null {
    return this.#through;
  }

  [Symbol.dispose](): void {
    this.#forgetThrough();
    this.#clear();
    for (const texture of this.#textures.values()) texture.dispose();
    this.#textures.clear();
  }

  #picture(camera: Camera, file: string, depth: number): Mesh<BufferGeometry, MeshBasicMaterial> {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new Float32BufferAttribute(cornersOf(camera, depth).flat(), 3));
    geometry.setAttribute('uv', new Float32BufferAttribute([0, 1, 1, 1, 1, 0, 0, 0], 2));
    geometry.setIndex([0, 2, 1, 0, 3, 2]);
    const material = new MeshBasicMaterial({ side: DoubleSide, toneMapped: false, visible: false });
    material.map = this.#texture(file, () => {
      material.visible = true;
      this.#wake();
    }, () => {
      if (this.#through?.material !== material) return;
      this.lookThrough(null);
      this.#onProblem('This photo cannot be shown.');
      this.#wake();
    });
    return new Mesh(geometry, material);
  }

  #texture(file: string, onLoad: () => void, onError: () => void): Texture {
    const known = this.#textures.get(file);
    if (known !== undefined) {
      const waiting = this.#waiting.get(file);
      if (waiting === undefined) onLoad();
      else waiting.push(onLoad);
      return known;
    }
    this.#waiting.set(file, [onLoad]);
    const texture = this.#loader.load(this.#urlOf(file), () => {
      const waiting = this.#waiting.get(file) ?? [];
      this.#waiting.delete(file);
      for (const tell of waiting) tell();
    }, undefined, onError);
    texture.colorSpace = SRGBColorSpace;
    this.#textures.set(file, texture);
    return texture;
  }

  /** Let all go but those of these files: a photo takes tens of megabytes on the card. */
  #forgetTextures(kept: ReadonlySet<string | null>): void {
    for (const [file, texture] of Array.from(this.#textures)) {
      if (kept.has(file)) continue;
      texture.dispose();
      this.#textures.delete(file);
      this.#waiting.delete(file);
    }
  }

  #forgetThrough(): void {
    const mesh = this.#through;
    this.#through = null;
    if (mesh === null) return;
    mesh.removeFromParent();
    mesh.geometry.dispose();
    mesh.material.dispose();
    this.#forgetTextures(new Set(this.#views.map(({ thumbnail }) => thumbnail)));
  }

  #clear(): void {
    for (const child of Array.from(this.group.children)) {
      this.group.remove(child);
      if (!(child instanceof LineSegments || child instanceof Line || child instanceof Mesh)) continue;
      (child.geometry as BufferGeometry).dispose();
      (child.material as MeshBasicMaterial).dispose();
    }
  }
}

function areSame(a: readonly object[], b: readonly object[]): boolean {
  return a.length === b.length && a.every((each, i) => each === b[i]);
}

function lines(
  cameras: readonly Camera[], depth: number, material: LineBasicMaterial,
): LineSegments<BufferGeometry, LineBasicMaterial> {
  const points: number[] = [];
  for (const camera of cameras) {
    const centre = positionOf(camera);
    const around = cornersOf(camera, depth);
    around.forEach((corner, i) => {
      points.push(...centre, ...corner, ...corner, ...(around[(i + 1) % 4] ?? corner));
    });
    points.push(...upMark(around));
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new Float32BufferAttribute(points, 3));
  return new LineSegments(geometry, material);
}

/** A small roof over the picture's upper side: which way it was held. */
function upMark([a, b, , d]: readonly Vector3[]): number[] {
  if (a === undefined || b === undefined || d === undefined) return [];
  const at = (along: number, above: number): number[] => [0, 1, 2].map((axis) =>
    (a[axis] ?? 0) + along * ((b[axis] ?? 0) - (a[axis] ?? 0)) + above * ((a[axis] ?? 0) - (d[axis] ?? 0)));
  return [...at(0.35, 0.04), ...at(0.5, 0.2), ...at(0.5, 0.2), ...at(0.65, 0.04)];
}

function pathOf(views: readonly PlaceView[]): Line {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new Float32BufferAttribute(views.flatMap(({ camera }) => positionOf(camera)), 3));
  return new Line(geometry, new LineBasicMaterial({ color: READY, transparent: true, opacity: 0.4 }));
}
