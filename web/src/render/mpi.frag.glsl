#version 300 es
precision highp float;

uniform sampler2D atlas; // premultiplied

in vec2 texel;
out vec4 colour;

void main() {
  colour = texture(atlas, texel);
}
