#version 300 es
// What is shown follows what is measured, smoothed (red channel), and changes (green channel) only
// when that is clear: however fast a pixel flickers, its change takes the time from LOW to HIGH.
precision highp float;

uniform sampler2D shown;
uniform sampler2D result;
uniform float share; // of the new one, 0...1

in vec2 uv;
out vec4 colour;

const float LOW = 0.25;
const float HIGH = 0.75;

void main() {
  vec2 before = texture(shown, uv).rg;
  float level = mix(before.r, texture(result, uv).r, share);
  float state = level > HIGH ? 1.0 : level < LOW ? 0.0 : before.g;
  colour = vec4(level, state, 0.0, 1.0);
}
