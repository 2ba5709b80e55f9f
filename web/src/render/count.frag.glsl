#version 300 es
// Counts peaked and missing pixels of one block as two 16-bit numbers: (peaked, missing) high, low.
precision highp float;

uniform sampler2D result;
uniform ivec2 blocks;

out vec4 counts;

void main() {
  ivec2 size = textureSize(result, 0);
  ivec2 block = ivec2(gl_FragCoord.xy);
  ivec2 from = block * size / blocks;
  ivec2 to = (block + 1) * size / blocks;
  vec2 sum = vec2(0.0);
  for (int y = from.y; y < to.y; y++) {
    for (int x = from.x; x < to.x; x++) sum += step(0.5, texelFetch(result, ivec2(x, y), 0).rg);
  }
  counts = vec4(floor(sum / 256.0), mod(sum, 256.0)) / 255.0;
}
