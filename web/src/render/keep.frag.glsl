#version 300 es
// Writes depth, and nothing else, where the picture is opaque: nothing that is drawn under it is seen.
precision highp float;

uniform sampler2D view;

out vec4 colour;

// What lets less through than half a step of 8 bits is opaque: OPAQUE in src/peaking/rendering/_numba.py.
const float OPAQUE = 1.0 - 1.0 / 512.0;

void main() {
  if (texelFetch(view, ivec2(gl_FragCoord.xy), 0).a < OPAQUE) discard;
  colour = vec4(0.0);
}
