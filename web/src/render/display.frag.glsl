#version 300 es
// The paper's three pictures, and what is marked on them; twin of src/peaking/overlay.py.
precision highp float;

uniform sampler2D view;
uniform sampler2D live;
uniform sampler2D shown; // green: wrong; alpha: never seen
uniform int base; // 0: the MPI over black, 1: the live picture
uniform bool peaks;
uniform float peak_opacity;
uniform bool pattern;
uniform bool apart;

in vec2 uv;
out vec4 colour;

const vec3 RED = vec3(1.0, 0.0, 0.0);
const float STRIPE_PX = 6.0;
const float WRONG_OPACITY = 0.67;
const vec3 CONTOUR = vec3(1.0, 0.88, 0.84);
const float CONTOUR_OPACITY = 0.6;
const vec3 UNSEEN = vec3(0.59, 0.65, 0.75);
const float HATCH_PX = 9.0;

// 1 where a mask that runs from 0 to 1 passes through its middle.
float border(float mask) {
  return 1.0 - smoothstep(0.2, 0.5, abs(mask - 0.5));
}

void main() {
  vec3 picture = texture(live, uv).rgb;
  vec3 rgb = base == 1 ? picture : texture(view, uv).rgb;
  if (peaks) {
    vec4 marks = texture(shown, uv);
    if (apart) {
      // The picture itself, grey and cool: one sees what is there, and that it is not captured.
      float unseen = smoothstep(0.35, 0.65, marks.a);
      vec3 cool = 0.55 * vec3(dot(picture, vec3(1.0 / 3.0))) + 0.15 * UNSEEN;
      float line = 1.0 - step(0.14, fract((gl_FragCoord.x - gl_FragCoord.y) / HATCH_PX));
      rgb = mix(rgb, mix(cool, UNSEEN, 0.5 * line), unseen);
      rgb = mix(rgb, UNSEEN, 0.9 * border(marks.a));
    }
    float wrong = smoothstep(0.35, 0.65, marks.g);
    vec3 paint = RED;
    if (pattern) {
      // Stripes that stand out by brightness, for eyes that do not tell red from green.
      float stripe = step(0.5, fract((gl_FragCoord.x + gl_FragCoord.y) / (2.0 * STRIPE_PX)));
      paint = mix(vec3(0.05, 0.05, 0.25), vec3(1.0, 0.9, 0.2), stripe);
    }
    rgb = mix(rgb, paint, wrong * peak_opacity * (apart ? WRONG_OPACITY : 1.0));
    if (apart) rgb = mix(rgb, CONTOUR, CONTOUR_OPACITY * peak_opacity * border(marks.g));
  }
  colour = vec4(rgb, 1.0);
}
