#version 300 es
// The paper's three pictures; twin of src/peaking/overlay.py.
precision highp float;

uniform sampler2D view;
uniform sampler2D live;
uniform sampler2D shown;
uniform int base; // 0: the MPI over black, 1: the live picture
uniform bool peaks;
uniform float peak_opacity;
uniform bool pattern;

in vec2 uv;
out vec4 colour;

const vec3 RED = vec3(1.0, 0.0, 0.0);
const float STRIPE_PX = 6.0;

void main() {
  vec3 rgb = base == 1 ? texture(live, uv).rgb : texture(view, uv).rgb;
  if (peaks) {
    float mask = smoothstep(0.35, 0.65, texture(shown, uv).g);
    vec3 paint = RED;
    if (pattern) {
      // Stripes that stand out by brightness, for eyes that do not tell red from green.
      float stripe = step(0.5, fract((gl_FragCoord.x + gl_FragCoord.y) / (2.0 * STRIPE_PX)));
      paint = mix(vec3(0.05, 0.05, 0.25), vec3(1.0, 0.9, 0.2), stripe);
    }
    rgb = mix(rgb, paint, mask * peak_opacity);
  }
  colour = vec4(rgb, 1.0);
}
