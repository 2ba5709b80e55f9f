#version 300 es
// Counts the pixels of one block of what is visible, two kinds at a time, as two 16-bit numbers:
// high bytes, low bytes. Lower half of the target: peaked and unseen; upper half: wrong, and where
// no view will help.
precision highp float;

uniform sampler2D result;
uniform ivec4 visible; // left, bottom, right, top, in pixels
uniform ivec2 blocks;

out vec4 counts;

void main() {
  ivec2 size = visible.zw - visible.xy;
  ivec2 block = ivec2(gl_FragCoord.xy);
  bool upper = block.y >= blocks.y;
  if (upper) block.y -= blocks.y;
  ivec2 from = visible.xy + block * size / blocks;
  ivec2 to = visible.xy + (block + 1) * size / blocks;
  vec2 sum = vec2(0.0);
  for (int y = from.y; y < to.y; y++) {
    for (int x = from.x; x < to.x; x++) {
      vec4 each = texelFetch(result, ivec2(x, y), 0);
      sum += step(0.25, upper ? vec2(each.r * (1.0 - each.g), each.a) : each.rg);
    }
  }
  counts = vec4(floor(sum / 256.0), mod(sum, 256.0)) / 255.0;
}
