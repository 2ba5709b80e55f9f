#version 300 es
// What is shown follows what is measured within some tenths of a second, so that nothing flashes.
precision highp float;

uniform sampler2D shown;
uniform sampler2D result;
uniform float share; // of the new one, 0...1

in vec2 uv;
out vec4 colour;

void main() {
  colour = vec4(mix(texture(shown, uv).r, texture(result, uv).r, share), 0.0, 0.0, 1.0);
}
