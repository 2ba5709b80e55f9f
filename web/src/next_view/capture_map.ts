/** The capture from above, drawn on a canvas: what was seen, cameras, what is left. */

import { fitting, type Marker, type PlanView } from './plan_view';

const VIEW = '#5bd68a';
const LEFT = '#fff';
const SURFACE = 'rgb(150 165 190 / 55%)';

/** @param here Where the photographer is now. @param size_px Of a camera's sign, in pixels of the canvas. */
export function drawMap(canvas: HTMLCanvasElement, plan: PlanView, size_px: number): void {
  const context = canvas.getContext('2d');
  if (context === null) return;
  const { width, height } = canvas;
  context.clearRect(0, 0, width, height);
  const fit = fitting(plan, width, height, 1.4 * size_px);
  const x = (x_m: number): number => fit.x_px + fit.scale * x_m;
  const y = (y_m: number): number => fit.y_px + fit.scale * y_m;
  context.fillStyle = SURFACE;
  const dot = Math.max(2, 0.22 * size_px);
  for (let i = 0; i < plan.surface.length; i += 2) {
    context.fillRect(x(plan.surface[i] ?? NaN) - dot / 2, y(plan.surface[i + 1] ?? NaN) - dot / 2, dot, dot);
  }
  const sign = ({ x_m, y_m, ahead_x, ahead_y }: Marker): void => {
    const length = Math.hypot(ahead_x, ahead_y) || 1;
    const ax = (size_px * ahead_x) / length;
    const ay = (size_px * ahead_y) / length;
    context.beginPath();
    context.moveTo(x(x_m), y(y_m));
    context.lineTo(x(x_m) + ax - 0.5 * ay, y(y_m) + ay + 0.5 * ax);
    context.lineTo(x(x_m) + ax + 0.5 * ay, y(y_m) + ay - 0.5 * ax);
    context.closePath();
    context.stroke();
  };
  context.lineWidth = Math.max(1.5, 0.14 * size_px);
  context.strokeStyle = VIEW;
  plan.views.forEach(sign);
  context.strokeStyle = LEFT;
  if (size_px > 20) context.setLineDash([0.3 * size_px, 0.22 * size_px]);
  plan.left.forEach(sign);
  context.setLineDash([]);
}

/** How the score went, view by view, over the whole canvas. */
export function drawCurve(
  canvas: HTMLCanvasElement, curve: readonly { readonly views: number; readonly score: number }[],
): void {
  const context = canvas.getContext('2d');
  if (context === null) return;
  const { width, height } = canvas;
  const last = Math.max(curve.at(-1)?.views ?? 1, 2);
  const x = (views: number): number => 4 + ((width - 8) * (views - 1)) / (last - 1);
  const y = (score: number): number => height - 4 - (height - 8) * score;
  context.clearRect(0, 0, width, height);
  context.strokeStyle = 'rgb(255 255 255 / 25%)';
  context.setLineDash([4, 5]);
  context.beginPath();
  context.moveTo(0, y(1));
  context.lineTo(width, y(1));
  context.stroke();
  context.setLineDash([]);
  context.strokeStyle = VIEW;
  context.lineWidth = 4;
  context.lineJoin = 'round';
  context.beginPath();
  for (const { views, score } of curve) context.lineTo(x(views), y(score));
  context.stroke();
  context.fillStyle = VIEW;
  for (const { views, score } of curve) context.fillRect(x(views) - 3, y(score) - 3, 6, 6);
}
