#version 300 es
// One tile of one MPI as a quad, projected into the target camera. docs/mpi-format.md, CONVENTIONS.md.
precision highp float;

layout(location = 0) in vec3 tile; // centre of its first texel (x, y), px; depth of its plane, m

// p_target = target_from_source * (ray * depth) + translation, in homogeneous pixels of the target
uniform mat3 target_from_ray;
uniform vec3 translation;
uniform float target_depth; // of the target camera along the source's +z, m
uniform vec2 target_size;
uniform vec2 texture_size;
uniform int texture_cols;

out vec2 texel;

const float CELL = 15.0;
const float TILE = 16.0;
// What is nearer than this to the target camera, or behind it, is not drawn: NEAR_M in Python.
const float NEAR = 1e-4;

void main() {
  if (tile.z - target_depth <= NEAR) {
    // From behind, a plane shows what nobody photographed. The whole quad lies outside.
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  vec2 source = tile.xy + CELL * corner;
  vec3 p = tile.z * (target_from_ray * vec3(source, 1.0)) + translation;
  vec2 first = TILE * vec2(gl_InstanceID % texture_cols, gl_InstanceID / texture_cols);
  texel = (first + 0.5 + CELL * corner) / texture_size;
  vec2 ndc = 2.0 * p.xy / target_size; // times w, as p.xy is
  // Bottom row first, as the live picture.
  gl_Position = vec4(ndc.x - p.z, p.z - ndc.y, p.z - 2.0 * NEAR, p.z);
}
