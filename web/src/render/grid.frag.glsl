#version 300 es
// Every fifth pixel from the top left: the view in the lower half, the live picture above it.
precision highp float;

uniform sampler2D view;
uniform sampler2D live;
uniform int stride;
uniform int rows;

out vec4 colour;

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  bool is_live = at.y >= rows;
  int row = is_live ? at.y - rows : at.y;
  int height = textureSize(view, 0).y;
  ivec2 from = ivec2(stride * at.x, height - 1 - stride * row);
  colour = is_live ? texelFetch(live, from, 0) : texelFetch(view, from, 0);
}
