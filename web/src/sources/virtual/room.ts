/**
 * A drawn, furnished room, 0.5 to 3 m around the photographer, with a mirror and a glass vase: a
 * study with a desk. Metres, y up; the photographer begins at `START` and looks along -z.
 */

import {
  AmbientLight, BackSide, BoxGeometry, Color, CylinderGeometry, DirectionalLight, DoubleSide, Group,
  LatheGeometry, Mesh, MeshBasicMaterial, MeshLambertMaterial, MeshPhongMaterial, PlaneGeometry,
  PointLight, Scene, SphereGeometry, TorusGeometry, Vector2, type BufferGeometry, type Material,
  type Texture,
} from 'three';
import { Reflector } from 'three/examples/jsm/objects/Reflector.js';
import * as textures from './textures';

/** Where the photographer begins, and how far down they look. */
export const START = { x_m: 0, y_m: 1.32, z_m: 0.75, pitch_rad: -0.22 } as const;

/** The photographer stays in here. */
export const WALKABLE = {
  low: { x: -1.5, y: 0.35, z: -0.35 }, high: { x: 1.5, y: 2.1, z: 1.4 },
} as const;

export interface Room {
  readonly scene: Scene;
  /** It draws the room a second time; to be left out where only depth is wanted. */
  readonly mirror: Reflector;
}

const HALF_WIDTH = 1.8;
const HEIGHT = 2.5;
const BACK = -1.5;
const FRONT = 1.7;

export function buildRoom(): Room {
  const scene = new Scene();
  scene.background = new Color(0x20242b);
  scene.add(new AmbientLight(0xfff4e6, 1.5));
  const sun = new DirectionalLight(0xffefd6, 1.6);
  sun.position.set(-2.5, 2.4, 1.2);
  scene.add(sun);
  const lamp = new PointLight(0xffc98a, 0.9, 2.2, 1.6);
  lamp.position.set(-0.52, 1.18, -1.05);
  scene.add(lamp);
  addWalls(scene);
  addDesk(scene);
  addThingsOnDesk(scene);
  addShelf(scene);
  addChair(scene, 0.46, -0.42);
  addPlant(scene, -1.05, -0.55);
  addSideboard(scene);
  const mirror = addMirror(scene);
  scene.updateMatrixWorld(true);
  return { scene, mirror };
}

function matte(map: Texture | null, colour = 0xffffff): MeshLambertMaterial {
  return new MeshLambertMaterial(map === null ? { color: colour } : { map, color: colour });
}

function place(
  parent: Scene | Group, geometry: BufferGeometry, material: Material | Material[],
  x: number, y: number, z: number, turn_rad = 0,
): Mesh {
  const mesh = new Mesh(geometry, material);
  mesh.position.set(x, y, z);
  mesh.rotation.y = turn_rad;
  parent.add(mesh);
  return mesh;
}

/** A soft shadow on whatever is horizontal there. */
function shade(parent: Scene | Group, x: number, y: number, z: number, w: number, d: number): void {
  const material = new MeshBasicMaterial({
    map: textures.shadow(), transparent: true, depthWrite: false,
  });
  const mesh = place(parent, new PlaneGeometry(w, d), material, x, y + 0.003, z);
  mesh.rotation.x = -Math.PI / 2;
  mesh.userData['noDepth'] = true;
}

function addWalls(scene: Scene): void {
  const depth = FRONT - BACK;
  const wall = textures.plaster(2, '#cdd6cf');
  const side = textures.plaster(4, '#d9cdb8');
  const floor = textures.wood(7, '#a9743f', '#5d3a1a');
  floor.repeat.set(3, 6);
  const faces: Material[] = [side, side, textures.plaster(6, '#efeae0'), floor, wall, wall]
    .map((map) => new MeshLambertMaterial({ map, side: BackSide }));
  place(scene, new BoxGeometry(2 * HALF_WIDTH, HEIGHT, depth), faces,
    0, HEIGHT / 2, (FRONT + BACK) / 2);
  const skirting = matte(null, 0xf2ede2);
  place(scene, new BoxGeometry(2 * HALF_WIDTH, 0.09, 0.02), skirting, 0, 0.045, BACK + 0.01);
  place(scene, new BoxGeometry(0.02, 0.09, depth), skirting, -HALF_WIDTH + 0.01, 0.045, 0.1);
  const carpet = place(scene, new PlaneGeometry(1.7, 1.1), matte(textures.rug(12)), 0, 0.006, 0.1);
  carpet.rotation.x = -Math.PI / 2;

  // A window in the left wall, and pictures on the back wall.
  const frame = matte(null, 0xf7f4ee);
  place(scene, new PlaneGeometry(0.9, 1.1), new MeshBasicMaterial({ map: textures.outside() }),
    -HALF_WIDTH + 0.015, 1.5, -0.5, Math.PI / 2);
  for (const z of [-0.95, -0.5, -0.05]) {
    place(scene, new BoxGeometry(0.05, 1.16, 0.05), frame, -HALF_WIDTH + 0.03, 1.5, z);
  }
  for (const y of [0.95, 1.5, 2.05]) {
    place(scene, new BoxGeometry(0.05, 0.05, 0.95), frame, -HALF_WIDTH + 0.03, y, -0.5);
  }
  place(scene, new BoxGeometry(0.16, 0.03, 1.05), frame, -HALF_WIDTH + 0.08, 0.92, -0.5);
  hang(scene, 'mountains', -0.62, 1.62, 0.36, 0.5);
  hang(scene, 'circles', -1.2, 1.55, 0.3, 0.42);
}

function hang(
  scene: Scene, kind: 'mountains' | 'circles', x: number, y: number, w: number, h: number,
): void {
  place(scene, new BoxGeometry(w + 0.05, h + 0.05, 0.025), matte(null, 0x2f261d),
    x, y, BACK + 0.015);
  place(scene, new PlaneGeometry(w, h), matte(textures.poster(kind)), x, y, BACK + 0.03);
}

function addDesk(scene: Scene): void {
  const top = textures.wood(17, '#c89a63', '#7a4d22');
  const legs = matte(null, 0x3c3f45);
  place(scene, new BoxGeometry(1.5, 0.04, 0.68), matte(top), 0, 0.73, -1.12);
  for (const x of [-0.7, 0.7]) {
    for (const z of [-1.42, -0.83]) {
      place(scene, new BoxGeometry(0.045, 0.71, 0.045), legs, x, 0.355, z);
    }
  }
  place(scene, new BoxGeometry(0.36, 0.46, 0.56), matte(textures.wood(19, '#b98a54', '#6d431c')),
    0.48, 0.47, -1.12);
  for (const y of [0.36, 0.51, 0.64]) {
    place(scene, new BoxGeometry(0.3, 0.012, 0.02), matte(null, 0x26282c), 0.48, y, -0.835);
  }
  shade(scene, 0, 0.008, -1.1, 1.7, 1.0);
}

function addThingsOnDesk(scene: Scene): void {
  const y = 0.75;
  // Monitor, keyboard, mouse.
  const dark = matte(null, 0x1d2025);
  place(scene, new BoxGeometry(0.62, 0.38, 0.03), dark, 0.08, y + 0.33, -1.3);
  place(scene, new PlaneGeometry(0.59, 0.35), new MeshBasicMaterial({ map: textures.screen() }),
    0.08, y + 0.33, -1.283);
  place(scene, new CylinderGeometry(0.02, 0.02, 0.16, 12), dark, 0.08, y + 0.08, -1.32);
  place(scene, new CylinderGeometry(0.12, 0.13, 0.015, 24), dark, 0.08, y + 0.008, -1.3);
  place(scene, new BoxGeometry(0.42, 0.018, 0.15),
    [dark, dark, matte(textures.keyboard()), dark, dark, dark], 0.06, y + 0.01, -0.96);
  const mouse = place(scene, new SphereGeometry(0.04, 16, 10), matte(null, 0xe8e6e1),
    0.36, y + 0.012, -0.95);
  mouse.scale.set(0.75, 0.45, 1.1);
  shade(scene, 0.08, y, -1.28, 0.5, 0.34);

  // A stack of books with a mug on it, a notebook, pencils.
  [[0x9c3d2e, 0.24, 0.05, 0.1], [0x2f5d62, 0.22, 0.04, -0.12], [0xd9a441, 0.2, 0.035, 0.2]]
    .reduce((below, [colour = 0, width = 0, thick = 0, turn = 0]) => {
      const cover = matte(null, colour);
      const pages = matte(null, 0xefe7d4);
      place(scene, new BoxGeometry(width, thick, 0.16), [pages, cover, cover, cover, cover, pages],
        -0.3, below + thick / 2, -0.98, turn);
      return below + thick;
    }, y);
  const mug = new Group();
  const glaze = new MeshPhongMaterial({
    map: textures.fabric(41, ['#2a6f97', '#2c7da0', '#468faf', '#f4f1de']), shininess: 60,
  });
  place(mug, new CylinderGeometry(0.042, 0.038, 0.095, 28, 1, true), glaze, 0, 0.048, 0);
  place(mug, new CylinderGeometry(0.04, 0.04, 0.005, 28), matte(null, 0x3b2213), 0, 0.075, 0);
  const handle = place(mug, new TorusGeometry(0.028, 0.007, 10, 20), glaze, 0.05, 0.048, 0);
  handle.scale.set(0.8, 1.1, 1);
  mug.position.set(-0.3, y + 0.125, -0.98);
  scene.add(mug);
  place(scene, new BoxGeometry(0.2, 0.012, 0.27), matte(textures.fabric(5, ['#31435e', '#2b3a52'])),
    0.6, y + 0.007, -0.98, -0.35);
  for (const [i, colour] of [0xd1495b, 0xedae49, 0x66a182].entries()) {
    const pencil = place(scene, new CylinderGeometry(0.004, 0.004, 0.17, 6), matte(null, colour),
      0.57 + 0.022 * i, y + 0.018, -0.96);
    pencil.rotation.set(Math.PI / 2, 0, 0.25 + 0.1 * i);
  }
  shade(scene, -0.3, y, -0.98, 0.36, 0.28);

  addLamp(scene, -0.56, y, -1.22);
  addVase(scene, 0.62, y, -1.3);
}

function addLamp(scene: Scene, x: number, y: number, z: number): void {
  const brass = new MeshPhongMaterial({ color: 0xb08d45, shininess: 80 });
  place(scene, new CylinderGeometry(0.07, 0.08, 0.02, 24), brass, x, y + 0.01, z);
  place(scene, new CylinderGeometry(0.008, 0.008, 0.36, 10), brass, x, y + 0.19, z);
  const profile = [[0.05, 0.5], [0.12, 0.34]].map(([r = 0, h = 0]) => new Vector2(r, h));
  place(scene, new LatheGeometry(profile, 28),
    new MeshLambertMaterial({ color: 0xf3d9a4, emissive: 0x8a6a30, side: DoubleSide }), x, y, z);
}

/** A glass vase with twigs: what depth sensors and planes do badly. */
function addVase(scene: Scene, x: number, y: number, z: number): void {
  const glass = new MeshPhongMaterial({
    color: 0xbfe3e0, transparent: true, opacity: 0.32, shininess: 160, specular: 0xffffff,
    side: DoubleSide, depthWrite: false,
  });
  const profile = [[0.0, 0.0], [0.05, 0.0], [0.062, 0.05], [0.05, 0.13], [0.032, 0.18], [0.04, 0.21]]
    .map(([r = 0, h = 0]) => new Vector2(r, h));
  place(scene, new LatheGeometry(profile, 32), glass, x, y, z);
  const random = textures.randomOf(77);
  const twig = matte(null, 0x5b4630);
  const leaf = matte(null, 0xc65b4b);
  for (let i = 0; i < 7; i += 1) {
    const lean = 0.35 * (random() - 0.5);
    const turn = 2 * Math.PI * random();
    const stem = place(scene, new CylinderGeometry(0.0025, 0.004, 0.42, 6), twig,
      x + 0.1 * lean * Math.cos(turn), y + 0.24, z + 0.1 * lean * Math.sin(turn));
    stem.rotation.set(lean * Math.sin(turn), 0, -lean * Math.cos(turn));
    place(scene, new SphereGeometry(0.016, 8, 6), leaf,
      x + (0.1 + 0.21) * lean * Math.cos(turn), y + 0.44, z + (0.1 + 0.21) * lean * Math.sin(turn));
  }
}

function addShelf(scene: Scene): void {
  const board = matte(textures.wood(23, '#8d5f35', '#4b2d12'));
  for (const [row, y] of [1.42, 1.78].entries()) {
    place(scene, new BoxGeometry(0.8, 0.025, 0.2), board, 0.42, y, BACK + 0.11);
    const spines = matte(textures.books(50 + row, 15));
    const pages = matte(null, 0xe9dfc8);
    place(scene, new BoxGeometry(0.5, 0.22, 0.15), [pages, pages, pages, pages, spines, pages],
      0.3 + 0.14 * row, y + 0.125, BACK + 0.1);
  }
  place(scene, new SphereGeometry(0.07, 24, 16), matte(textures.fabric(61, ['#3c6e71', '#f4f1de'])),
    0.72, 1.505, BACK + 0.12);
  place(scene, new BoxGeometry(0.12, 0.16, 0.02), matte(textures.poster('circles')),
    0.12, 1.88, BACK + 0.12, 0.3);
}

function addChair(scene: Scene, x: number, z: number): void {
  const cloth = matte(textures.fabric(71, ['#b5651d', '#c8752a', '#a85a18', '#d28a45']));
  const metal = matte(null, 0x2a2d31);
  const chair = new Group();
  place(chair, new BoxGeometry(0.44, 0.07, 0.42), cloth, 0, 0.46, 0);
  place(chair, new BoxGeometry(0.42, 0.46, 0.06), cloth, 0, 0.76, 0.2);
  for (const dx of [-0.18, 0.18]) {
    for (const dz of [-0.17, 0.17]) {
      place(chair, new CylinderGeometry(0.014, 0.014, 0.43, 8), metal, dx, 0.215, dz);
    }
  }
  chair.position.set(x, 0, z);
  chair.rotation.y = 0.5;
  scene.add(chair);
  shade(scene, x, 0.01, z, 0.8, 0.8);
}

function addPlant(scene: Scene, x: number, z: number): void {
  place(scene, new CylinderGeometry(0.17, 0.13, 0.3, 28),
    matte(textures.fabric(81, ['#e2ddd3', '#d6d0c4', '#c9c2b4'])), x, 0.15, z);
  place(scene, new CylinderGeometry(0.155, 0.155, 0.01, 24), matte(null, 0x3a2a1c), x, 0.297, z);
  const random = textures.randomOf(99);
  for (let i = 0; i < 26; i += 1) {
    const green = new Color().setHSL(0.27 + 0.08 * random(), 0.5, 0.22 + 0.2 * random());
    const leaf = place(scene, new SphereGeometry(0.13, 10, 6),
      new MeshLambertMaterial({ color: green }),
      x + 0.34 * (random() - 0.5), 0.5 + 0.62 * random(), z + 0.34 * (random() - 0.5));
    leaf.scale.set(0.32 + 0.3 * random(), 0.1, 1);
    leaf.rotation.set(1.6 * (random() - 0.5), 2 * Math.PI * random(), 1.6 * (random() - 0.5));
  }
  shade(scene, x, 0.01, z, 0.7, 0.7);
}

/** Along the right wall, under the mirror. */
function addSideboard(scene: Scene): void {
  const front = textures.wood(27, '#7d8f88', '#4e5f59');
  place(scene, new BoxGeometry(0.4, 0.72, 1.1), matte(front), HALF_WIDTH - 0.21, 0.36, -0.6);
  for (const z of [-0.85, -0.35]) {
    place(scene, new SphereGeometry(0.018, 12, 8), matte(null, 0xc9a24b), HALF_WIDTH - 0.42, 0.42, z);
  }
  place(scene, new CylinderGeometry(0.06, 0.09, 0.24, 24), matte(textures.fabric(91,
    ['#335c67', '#e09f3e', '#9e2a2b', '#fff3b0'])), HALF_WIDTH - 0.24, 0.84, -0.9);
  place(scene, new BoxGeometry(0.2, 0.14, 0.3), matte(textures.books(95, 6)),
    HALF_WIDTH - 0.24, 0.79, -0.35, 0.2);
}

/** On the back wall, right of the shelf: what it shows is further away than it is. */
function addMirror(scene: Scene): Reflector {
  const x = 1.28;
  place(scene, new BoxGeometry(0.5, 0.82, 0.025), matte(null, 0x8a6a3a), x, 1.42, BACK + 0.014);
  const mirror = new Reflector(new PlaneGeometry(0.44, 0.76), {
    textureWidth: 192, textureHeight: 332, color: 0xb8bcc0, multisample: 0,
  });
  mirror.position.set(x, 1.42, BACK + 0.03);
  scene.add(mirror);
  return mirror;
}
