#version 300 es
// One view's share of the blend; added to those of the others.
precision highp float;

uniform sampler2D view;
uniform float weight;

in vec2 uv;
out vec4 colour;

void main() {
  colour = weight * texture(view, uv);
}
