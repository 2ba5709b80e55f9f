/** 3D Gaussians in a scene of three.js, drawn by Spark. */

import { SparkRenderer, SplatMesh } from '@sparkjsdev/spark';
import { Group, type Vector3, type WebGLRenderer } from 'three';

export class Splats implements Disposable {
  readonly group = new Group();
  readonly #spark: SparkRenderer;
  readonly #wake: () => void;
  #mesh: SplatMesh | null = null;
  /** Goes up with every file that is to be shown: one that comes too late is let go. */
  #wanted = 0;

  constructor(renderer: WebGLRenderer, wake: () => void) {
    this.#wake = wake;
    this.#spark = new SparkRenderer({ renderer, onDirty: wake });
    this.group.add(this.#spark);
  }

  get count(): number {
    return this.#mesh?.packedSplats?.numSplats ?? 0;
  }

  /** From a place: how far half of the Gaussians are, and nearly all; null without any. */
  reachFrom(at: Vector3): { readonly median: number; readonly most: number } | null {
    const mesh = this.#mesh;
    if (mesh === null || this.count === 0) return null;
    const every = Math.max(1, Math.floor(this.count / 5000));
    const away: number[] = [];
    mesh.forEachSplat((index, centre) => {
      if (index % every === 0) away.push(centre.distanceTo(at));
    });
    away.sort((a, b) => a - b);
    const of = (share: number): number => away[Math.floor(share * (away.length - 1))] ?? 1;
    return { median: of(0.5), most: of(0.98) };
  }

  /**
   * Show the Gaussians of a file in place of those before, once they are there.
   *
   * @throws An error that says what is wrong with the file.
   */
  async show(bytes: ArrayBuffer, fileName: string): Promise<void> {
    const number = this.#wanted += 1;
    const mesh = new SplatMesh({ fileBytes: new Uint8Array(bytes), fileName });
    await mesh.initialized;
    if (number !== this.#wanted) return mesh.dispose();
    const before = this.#mesh;
    this.#mesh = mesh;
    this.group.add(mesh);
    if (before !== null) {
      this.group.remove(before);
      before.dispose();
    }
    this.#wake();
  }

  [Symbol.dispose](): void {
    this.#wanted += 1;
    this.#mesh?.dispose();
    this.group.clear();
  }
}
