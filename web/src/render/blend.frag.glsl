#version 300 es
// c = sum(w a c) / sum(w a), premultiplied in and out; twin of src/peaking/rendering/blending.py.
precision highp float;

// MAX_NEIGHBOURS of the wire; a test compares them.
const int MAX_VIEWS = 8;

uniform sampler2D views[MAX_VIEWS];
uniform float weights[MAX_VIEWS];
uniform int count;
uniform bool opacity_of_seen;

in vec2 uv;
out vec4 colour;

void add(vec4 view, float weight, inout vec4 sum, inout float most) {
  sum += weight * view;
  most = max(most, view.a);
}

void main() {
  vec4 sum = vec4(0.0);
  float most = 0.0;
  // Samplers can only be indexed by constants.
  if (count > 0) add(texture(views[0], uv), weights[0], sum, most);
  if (count > 1) add(texture(views[1], uv), weights[1], sum, most);
  if (count > 2) add(texture(views[2], uv), weights[2], sum, most);
  if (count > 3) add(texture(views[3], uv), weights[3], sum, most);
  if (count > 4) add(texture(views[4], uv), weights[4], sum, most);
  if (count > 5) add(texture(views[5], uv), weights[5], sum, most);
  if (count > 6) add(texture(views[6], uv), weights[6], sum, most);
  if (count > 7) add(texture(views[7], uv), weights[7], sum, most);
  if (sum.a <= 0.0) {
    colour = vec4(0.0);
    return;
  }
  float alpha = opacity_of_seen ? most : min(sum.a, 1.0);
  colour = vec4(sum.rgb / sum.a * alpha, alpha);
}
