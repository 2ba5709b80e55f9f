/** Draws the tiles of one MPI, far to near, into the target that is bound. */

import { resized, type Camera, type PinholeScratch } from '../geometry';
import { TEXTURE_COLS } from '../mpi/decode';
import { TILE_PX } from '../mpi/mpi_file';
import type { GpuMpi } from '../mpi/mpi_store';
import type { Program } from './program';
import { project, type Projection } from './projection';

/** Room for `drawMpi`. */
export interface QuadScratch {
  readonly small: PinholeScratch;
  readonly projection: Projection;
}

/**
 * @param program In use, with `mpi.vert.glsl`; the MPI's texture is bound to unit 0.
 * @param size Of the target.
 */
export function drawMpi(
  gl: WebGL2RenderingContext, program: Program, mpi: GpuMpi, camera: Camera,
  size: { readonly width: number; readonly height: number }, scratch: QuadScratch,
): void {
  const small = resized(camera.pinhole, size.width, size.height, scratch.small);
  const { matrix, translation, targetDepth_m } = project(
    mpi.camera, camera.worldFromCam, small, scratch.projection);
  gl.uniformMatrix3fv(program.uniform('target_from_ray'), false, matrix);
  gl.uniform3fv(program.uniform('translation'), translation);
  gl.uniform1f(program.uniform('target_depth'), targetDepth_m);
  gl.uniform2f(program.uniform('target_size'), small.width_px, small.height_px);
  const cols = TEXTURE_COLS;
  const rows = Math.max(Math.ceil(mpi.numTiles / cols), 1);
  gl.uniform2f(program.uniform('texture_size'), TILE_PX * cols, TILE_PX * rows);
  gl.uniform1i(program.uniform('texture_cols'), cols);
  gl.uniform1i(program.uniform('atlas'), 0);
  gl.enable(gl.BLEND);
  gl.blendEquation(gl.FUNC_ADD);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  gl.bindVertexArray(mpi.vertexArray);
  gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, mpi.numTiles);
  gl.bindVertexArray(null);
  gl.disable(gl.BLEND);
}
