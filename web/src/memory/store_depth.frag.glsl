#version 300 es
// Depth of a view as 16-bit millimetres in red (low) and green; 0 where it saw no surface.
precision highp float;

uniform sampler2D sums; // alpha * depth, 0, 0, alpha

out vec4 colour;

const float OPAQUE = 0.9; // of src/peaking/memory/

void main() {
  vec4 sum = texelFetch(sums, ivec2(gl_FragCoord.xy), 0);
  float mm = sum.a > OPAQUE ? floor(1000.0 * sum.r / sum.a + 0.5) : 0.0;
  if (!(mm > 0.0 && mm <= 65535.0)) mm = 0.0;
  float high = floor(mm / 256.0);
  colour = vec4(mm - 256.0 * high, high, 0.0, 255.0) / 255.0;
}
