#version 300 es
// Mean opacity of every block, top row first; twin of mean_opacity in src/peaking/hole_filling.py.
precision highp float;

uniform sampler2D view; // premultiplied
uniform ivec2 blocks;

out vec4 opacity;

void main() {
  ivec2 size = textureSize(view, 0);
  ivec2 block = ivec2(gl_FragCoord.xy);
  ivec2 from = block * size / blocks;
  ivec2 to = (block + 1) * size / blocks;
  float sum = 0.0;
  for (int y = from.y; y < to.y; y++) {
    for (int x = from.x; x < to.x; x++) sum += texelFetch(view, ivec2(x, size.y - 1 - y), 0).a;
  }
  opacity = vec4(sum / float((to.x - from.x) * (to.y - from.y)), 0.0, 0.0, 1.0);
}
