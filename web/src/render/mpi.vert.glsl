#version 300 es
// One tile of one MPI as a quad, projected into the target camera. docs/mpi-format.md, CONVENTIONS.md.
precision highp float;

layout(location = 0) in vec3 tile; // centre of its first texel (x, y), px; depth of its plane, m

// p_target = target_from_source * (ray * depth) + translation, in homogeneous pixels of the target
uniform mat3 target_from_ray;
uniform vec3 translation;
uniform vec2 target_size;
uniform vec2 texture_size;
uniform int texture_cols;

out vec2 texel;

const float CELL = 15.0;
const float TILE = 16.0;

void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  vec2 source = tile.xy + CELL * corner;
  vec3 p = tile.z * (target_from_ray * vec3(source, 1.0)) + translation;
  vec2 first = TILE * vec2(gl_InstanceID % texture_cols, gl_InstanceID / texture_cols);
  texel = (first + 0.5 + CELL * corner) / texture_size;
  vec2 ndc = 2.0 * p.xy / target_size; // times w, as p.xy is
  // Bottom row first, as the live picture; what is nearer than 1 cm is cut.
  gl_Position = vec4(ndc.x - p.z, p.z - ndc.y, p.z - 0.02, p.z);
}
