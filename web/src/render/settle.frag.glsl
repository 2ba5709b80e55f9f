#version 300 es
// What is shown follows what is measured, smoothed, and changes only when that is clear: however
// fast a pixel flickers, its change takes the time from LOW to HIGH. Red and green: level and state
// of what is peaked; blue and alpha: of what no view shows, where that is marked apart.
precision highp float;

uniform sampler2D shown;
uniform sampler2D result;
uniform float share; // of the new one, 0...1
uniform bool apart;

in vec2 uv;
out vec4 colour;

const float LOW = 0.25;
const float HIGH = 0.75;

vec2 settled(vec2 before, float measured) {
  float level = mix(before.x, measured, share);
  return vec2(level, level > HIGH ? 1.0 : level < LOW ? 0.0 : before.y);
}

void main() {
  vec4 before = texture(shown, uv);
  vec2 measured = texture(result, uv).rg;
  float unseen = apart ? measured.g : 0.0;
  colour = vec4(settled(before.rg, measured.r * (1.0 - unseen)), settled(before.ba, unseen));
}
