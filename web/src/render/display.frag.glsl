#version 300 es
// The paper's three pictures, and what is marked on them; twin of src/peaking/overlay.py.
precision highp float;

uniform sampler2D view;
uniform sampler2D live;
uniform sampler2D shown; // red: wrong; green: never seen; blue: no view will help
uniform int base; // 0: the MPI over black, 1: the live picture
uniform bool peaks;
uniform float peak_opacity;
uniform bool pattern; // for eyes that do not tell red from green
uniform bool apart;

in vec2 uv;
out vec4 colour;

// Lengths in pixels of the view, so that patterns look alike on every screen.
const vec3 RED = vec3(1.0, 0.0, 0.0);
const float STRIPE_PX = 4.0;
const vec3 STRIPE_DARK = vec3(0.05, 0.05, 0.25);
const vec3 STRIPE_LIGHT = vec3(1.0, 0.9, 0.2);
const float WRONG_OPACITY = 0.67;
const vec3 CONTOUR = vec3(1.0, 0.88, 0.84);
const float CONTOUR_OPACITY = 0.6;
const vec3 UNSEEN = vec3(0.59, 0.65, 0.75);
const float HATCH_PX = 6.0;
const vec3 AMBER = vec3(1.0, 0.69, 0.0);
const vec3 AMBER_RIM = vec3(0.12, 0.08, 0.0);
const float DOT_EVERY_PX = 8.0;
const float DOT_PX = 1.6; // radius
const float RIM_PX = 0.9;

// Pixels of the screen per pixel of the view.
float scale;

// 1 where a mask that runs from 0 to 1 passes through its middle.
float border(float mask) {
  return 1.0 - smoothstep(0.3, 0.5, abs(mask - 0.5));
}

// Where a screen has no more pixels than the view, masks would jump from 0 to 1: no border then.
vec3 marksAt(vec2 there) {
  if (scale > 1.25) return texture(shown, there).rgb;
  vec2 aside = 0.25 / vec2(textureSize(shown, 0));
  vec3 right = texture(shown, there + aside).rgb + texture(shown, there + vec2(aside.x, -aside.y)).rgb;
  vec3 left = texture(shown, there - aside).rgb + texture(shown, there - vec2(aside.x, -aside.y)).rgb;
  return 0.25 * (right + left);
}

// A line of one pixel across, every so many.
float line(float along, float every_px) {
  return 1.0 - step(1.0, mod(along - 0.5, every_px));
}

float disc(vec2 from_middle, float radius_px) {
  return clamp((radius_px - length(from_middle)) * scale + 0.5, 0.0, 1.0);
}

// The picture itself, grey and cool: one sees what is there, and that it is not captured.
vec3 paintUnseen(vec3 rgb, float mask, vec3 picture, vec2 at) {
  vec3 cool = 0.55 * vec3(dot(picture, vec3(1.0 / 3.0))) + 0.15 * UNSEEN;
  float hatch = 0.5 * line(at.x + at.y, HATCH_PX);
  vec3 light = UNSEEN;
  if (pattern) {
    // Crossed, light on dark, whatever is there.
    hatch = max(2.0 * hatch, line(at.x - at.y, HATCH_PX));
    light = mix(UNSEEN, vec3(1.0), 0.4);
    cool *= 0.5;
  }
  rgb = mix(rgb, mix(cool, light, hatch), smoothstep(0.35, 0.65, mask));
  return mix(rgb, UNSEEN, 0.9 * border(mask));
}

vec3 paintUnfixable(vec3 rgb, float mask, vec2 at) {
  vec2 from_middle = mod(at, DOT_EVERY_PX) - 0.5 * DOT_EVERY_PX;
  float rim = disc(from_middle, DOT_PX + RIM_PX * (pattern ? 2.0 : 1.0));
  float inside = smoothstep(0.35, 0.65, mask);
  rgb = mix(rgb, AMBER_RIM, (pattern ? 1.0 : 0.6) * rim * inside);
  rgb = mix(rgb, AMBER, disc(from_middle, DOT_PX) * inside);
  return mix(rgb, AMBER, 0.9 * border(mask));
}

vec3 paintWrong(vec3 rgb, float mask, vec2 at) {
  vec3 paint = RED;
  if (pattern) {
    // Stripes that stand out by brightness.
    paint = mix(STRIPE_DARK, STRIPE_LIGHT, step(0.5, fract((at.x - at.y) / (2.0 * STRIPE_PX))));
  }
  float opacity = peak_opacity * (apart ? WRONG_OPACITY : 1.0);
  rgb = mix(rgb, paint, smoothstep(0.35, 0.65, mask) * opacity);
  return apart ? mix(rgb, CONTOUR, CONTOUR_OPACITY * peak_opacity * border(mask)) : rgb;
}

void main() {
  vec3 picture = texture(live, uv).rgb;
  vec3 rgb = base == 1 ? picture : texture(view, uv).rgb;
  if (peaks) {
    vec2 size = vec2(textureSize(view, 0));
    vec2 at = vec2(uv.x, 1.0 - uv.y) * size; // from the top left, as in Python
    scale = 1.0 / dFdx(at.x);
    vec3 marks = apart ? marksAt(uv) : texture(shown, uv).rgb;
    if (apart) rgb = paintUnseen(rgb, marks.g, picture, at);
    rgb = paintWrong(rgb, marks.r, at);
    if (apart) rgb = paintUnfixable(rgb, marks.b, at);
  }
  colour = vec4(rgb, 1.0);
}
