#version 300 es
// What is shown follows what is measured, smoothed, and changes only when that is clear: however
// fast a pixel flickers, its change takes the time from LOW to HIGH. Red: what is wrong; green and
// blue, where these are marked apart: what was never seen, and where no view will help.
precision highp float;

uniform sampler2D levels;
uniform sampler2D states;
uniform sampler2D result;
uniform float share; // of the new one, 0...1
uniform bool apart;

layout(location = 0) out vec4 level;
layout(location = 1) out vec4 state;

const float LOW = 0.25;
const float HIGH = 0.75;

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 measured = texelFetch(result, at, 0);
  float unseen = apart ? measured.g : 0.0;
  vec3 marked = vec3(measured.r * (1.0 - unseen), unseen, step(0.25, measured.a));
  vec3 now = mix(texelFetch(levels, at, 0).rgb, marked, share);
  vec3 kept = max(texelFetch(states, at, 0).rgb, step(HIGH, now));
  level = vec4(now, 1.0);
  state = vec4(kept * step(LOW, now), 1.0);
}
