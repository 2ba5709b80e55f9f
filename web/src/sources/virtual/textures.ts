/** Textures of the drawn room, painted at start; the same every time. */

import {
  CanvasTexture, LinearMipmapLinearFilter, RepeatWrapping, SRGBColorSpace, type Texture,
} from 'three';

export type Random = () => number;

/** Numbers 0…1 that are the same for the same seed (mulberry32). */
export function randomOf(seed: number): Random {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let t = state;
    t = Math.imul(t ^ (t >>> 15), t | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

type Painter = (g: CanvasRenderingContext2D, width: number, height: number, random: Random) => void;

function painted(width: number, height: number, seed: number, paint: Painter): Texture {
  const canvas = document.createElement('canvas');
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext('2d');
  if (context === null) throw new Error('this browser has no 2D canvas');
  paint(context, width, height, randomOf(seed));
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  texture.wrapS = RepeatWrapping;
  texture.wrapT = RepeatWrapping;
  texture.minFilter = LinearMipmapLinearFilter;
  texture.anisotropy = 4;
  return texture;
}

export function wood(seed: number, light: string, dark: string): Texture {
  return painted(512, 256, seed, (g, w, h, random) => {
    g.fillStyle = light;
    g.fillRect(0, 0, w, h);
    g.strokeStyle = dark;
    for (let i = 0; i < 130; i += 1) {
      const y = random() * h;
      const bend = 4 + random() * 10;
      g.globalAlpha = 0.08 + 0.25 * random();
      g.lineWidth = 0.6 + random() * 2.2;
      g.beginPath();
      g.moveTo(0, y);
      g.bezierCurveTo(w / 3, y + bend, (2 * w) / 3, y - bend, w, y);
      g.stroke();
    }
    for (let i = 0; i < 5; i += 1) {
      const x = random() * w;
      const y = random() * h;
      for (let r = 2; r < 16; r += 3) {
        g.globalAlpha = 0.25;
        g.beginPath();
        g.ellipse(x, y, r * 2, r * 0.7, 0, 0, 2 * Math.PI);
        g.stroke();
      }
    }
  });
}

/** A painted wall: nearly one colour, with the unevenness of a roller. */
export function plaster(seed: number, colour: string): Texture {
  return painted(512, 512, seed, (g, w, h, random) => {
    g.fillStyle = colour;
    g.fillRect(0, 0, w, h);
    for (let i = 0; i < 2600; i += 1) {
      g.globalAlpha = 0.05;
      g.fillStyle = random() < 0.5 ? '#fff' : '#4a3c2c';
      const size = 2 + random() * 16;
      g.fillRect(random() * w, random() * h, size, size * (0.5 + random()));
    }
  });
}

export function fabric(seed: number, colours: readonly string[]): Texture {
  return painted(256, 256, seed, (g, w, h, random) => {
    for (let y = 0; y < h; y += 4) {
      for (let x = 0; x < w; x += 4) {
        g.fillStyle = colours[Math.floor(random() * colours.length)] ?? '#888';
        g.fillRect(x, y, 4, 4);
      }
    }
    g.globalAlpha = 0.25;
    g.fillStyle = '#000';
    for (let y = 0; y < h; y += 4) g.fillRect(0, y, w, 1);
  });
}

/** A woven rug: borders and diamonds. */
export function rug(seed: number): Texture {
  return painted(512, 320, seed, (g, w, h, random) => {
    g.fillStyle = '#7b2f2a';
    g.fillRect(0, 0, w, h);
    for (const [inset, colour] of [[10, '#e0c79a'], [22, '#2b3a55'], [40, '#b4573d']] as const) {
      g.strokeStyle = colour;
      g.lineWidth = 7;
      g.strokeRect(inset, inset, w - 2 * inset, h - 2 * inset);
    }
    for (let y = 70; y < h - 40; y += 42) {
      for (let x = 70; x < w - 40; x += 42) {
        g.fillStyle = ['#e0c79a', '#2b3a55', '#d98b4a', '#8fa66b'][Math.floor(random() * 4)] ?? '#fff';
        g.beginPath();
        g.moveTo(x, y - 17);
        g.lineTo(x + 17, y);
        g.lineTo(x, y + 17);
        g.lineTo(x - 17, y);
        g.fill();
      }
    }
  });
}

/** A picture for the wall. */
export function poster(kind: 'mountains' | 'circles'): Texture {
  return painted(256, 352, kind === 'circles' ? 5 : 9, (g, w, h, random) => {
    const sky = g.createLinearGradient(0, 0, 0, h);
    sky.addColorStop(0, kind === 'circles' ? '#f2e6cf' : '#f6c98f');
    sky.addColorStop(1, kind === 'circles' ? '#e8d3b0' : '#d9705a');
    g.fillStyle = sky;
    g.fillRect(0, 0, w, h);
    if (kind === 'circles') {
      for (let i = 0; i < 22; i += 1) {
        g.globalAlpha = 0.75;
        g.fillStyle = ['#1f4e5f', '#d1495b', '#edae49', '#66a182', '#2e4057'][i % 5] ?? '#000';
        g.beginPath();
        g.arc(random() * w, random() * h * 0.85, 8 + random() * 38, 0, 2 * Math.PI);
        g.fill();
      }
      g.globalAlpha = 1;
      g.fillStyle = '#2e4057';
      g.font = 'bold 30px sans-serif';
      g.fillText('PARALLAX', 46, h - 18);
      return;
    }
    g.fillStyle = '#fff3d6';
    g.beginPath();
    g.arc(w * 0.66, h * 0.3, 30, 0, 2 * Math.PI);
    g.fill();
    ['#8b5a6b', '#5d4a66', '#3a3550', '#1f2238'].forEach((colour, layer) => {
      g.fillStyle = colour;
      g.beginPath();
      g.moveTo(0, h);
      for (let x = 0; x <= w; x += 16) {
        g.lineTo(x, h * (0.42 + 0.14 * layer) + 26 * Math.sin(x / (22 + 9 * layer) + 2 * layer)
          - random() * 12);
      }
      g.lineTo(w, h);
      g.fill();
    });
  });
}

/** Spines of books, `count` beside each other. */
export function books(seed: number, count: number): Texture {
  return painted(512, 256, seed, (g, w, h, random) => {
    g.fillStyle = '#1c1712';
    g.fillRect(0, 0, w, h);
    const words = ['LIGHT', 'FIELDS', 'OPTICS', 'VIEW', 'PLANES', 'DEPTH', 'SCENE', 'RAYS'];
    let x = 0;
    for (let i = 0; i < count; i += 1) {
      const width = (w / count) * (0.75 + random() * 0.5);
      const top = random() * h * 0.22;
      g.fillStyle = `hsl(${Math.floor(random() * 360)} ${35 + random() * 35}% ${28 + random() * 30}%)`;
      g.fillRect(x, top, width - 2, h - top);
      g.fillStyle = 'rgba(255, 240, 210, 0.85)';
      g.fillRect(x + 3, top + 14, width - 8, 3);
      g.fillRect(x + 3, h - 20, width - 8, 3);
      g.save();
      g.translate(x + width / 2 + 5, h - 34);
      g.rotate(-Math.PI / 2);
      g.font = `bold ${Math.min(width * 0.45, 20)}px sans-serif`;
      g.fillText(words[Math.floor(random() * words.length)] ?? '', 0, 0);
      g.restore();
      x += width;
      if (x > w) break;
    }
  });
}

/** What a monitor shows: an editor with coloured lines. */
export function screen(): Texture {
  return painted(512, 320, 21, (g, w, h, random) => {
    g.fillStyle = '#10151f';
    g.fillRect(0, 0, w, h);
    g.fillStyle = '#1b2333';
    g.fillRect(0, 0, 100, h);
    g.fillRect(0, 0, w, 22);
    for (let y = 36; y < h - 20; y += 15) {
      let x = 116 + 18 * Math.floor(random() * 4);
      while (x < 430 && random() < 0.82) {
        const width = 14 + random() * 60;
        g.fillStyle = ['#7fdbca', '#c792ea', '#ffcb6b', '#82aaff', '#9aa5b1'][
          Math.floor(random() * 5)] ?? '#fff';
        g.fillRect(x, y, width, 7);
        x += width + 8;
      }
      g.fillStyle = '#4b5a73';
      g.fillRect(14, y, 30 + random() * 50, 6);
    }
  });
}

export function keyboard(): Texture {
  return painted(256, 96, 3, (g, w, h) => {
    g.fillStyle = '#c9ccd1';
    g.fillRect(0, 0, w, h);
    g.fillStyle = '#33373d';
    for (let row = 0; row < 5; row += 1) {
      for (let x = 6; x < w - 14; x += 16) g.fillRect(x + (row % 2) * 3, 7 + 17 * row, 13, 13);
    }
  });
}

/** The world outside the window. */
export function outside(): Texture {
  return painted(256, 256, 31, (g, w, h, random) => {
    const sky = g.createLinearGradient(0, 0, 0, h);
    sky.addColorStop(0, '#8ec5f0');
    sky.addColorStop(1, '#e9f3f7');
    g.fillStyle = sky;
    g.fillRect(0, 0, w, h);
    for (let i = 0; i < 150; i += 1) {
      g.fillStyle = ['#4b7a3f', '#6a9a4f', '#88b566', '#3c6335'][i % 4] ?? '#000';
      g.globalAlpha = 0.8;
      g.beginPath();
      g.arc(random() * w, h * (0.72 + 0.3 * random()), 6 + random() * 20, 0, 2 * Math.PI);
      g.fill();
    }
  });
}

/** A soft dark spot: what a lamp in the ceiling leaves under things. */
export function shadow(): Texture {
  return painted(64, 64, 1, (g, w, h) => {
    const soft = g.createRadialGradient(w / 2, h / 2, 4, w / 2, h / 2, w / 2);
    soft.addColorStop(0, 'rgba(0, 0, 0, 0.6)');
    soft.addColorStop(1, 'rgba(0, 0, 0, 0)');
    g.fillStyle = soft;
    g.fillRect(0, 0, w, h);
  });
}
