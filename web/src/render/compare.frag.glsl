#version 300 es
// L1 over RGB between the view and the live picture; twin of src/peaking/error_map/.
precision highp float;

uniform sampler2D view; // premultiplied
uniform sampler2D live;
uniform vec4 exposure; // live / view per channel, and the log of that in the corners on top of it
uniform float threshold;
uniform float shift_px;
uniform bool apart; // what was never shown counts, whatever its colour; what no view helps does not
uniform sampler2D memory; // red: never seen, green: no view will help; 0 or 1, of any smaller size
uniform bool remembers;

// Peaked, unseen, error / 3 (where that is below the threshold, undisplaced and so an upper bound),
// and why no view will help: 0 one will, 0.5 the memory says so, 1 it is over-exposed.
out vec4 result;

const float MIN_ALPHA = 0.5;
const float BLOWN_OUT = 250.0 / 255.0; // in all channels: brighter than the camera can tell
const float BRIGHT = 0.85; // in all channels of the view, at the picture's exposure

// By how much the live picture is brighter here; a pixel aside it is the same but for a trifle.
vec3 brighter(ivec2 at, vec2 size) {
  vec2 from_middle = vec2(at) + 0.5 - 0.5 * size;
  float falloff = exposure.a * dot(from_middle, from_middle) / (0.25 * dot(size, size));
  return exposure.rgb * exp(falloff);
}

vec3 rendered(ivec2 at, vec3 gain) {
  vec4 c = texelFetch(view, at, 0);
  return clamp((c.a > 0.0 ? c.rgb / c.a : vec3(0.0)) * gain, 0.0, 1.0);
}

float l1(vec3 a, vec3 b) {
  vec3 differs = abs(a - b);
  return differs.r + differs.g + differs.b;
}

// The least L1 of a picture that is displaced in nine ways, to one pixel of the other.
float least(vec3 around[9], vec3 still) {
  float found = 9.0;
  for (int y = 0; y < 3; y++) {
    float part_y = y == 1 ? 0.0 : shift_px;
    for (int x = 0; x < 3; x++) {
      float part_x = x == 1 ? 0.0 : shift_px;
      vec3 row = mix(around[4], around[3 + x], part_x);
      vec3 other = mix(around[3 * y + 1], around[3 * y + x], part_x);
      found = min(found, l1(mix(row, other, part_y), still));
    }
  }
  return found;
}

// The picture is as bright as it can be, and the view of a bright thing: what it shows dark is wrong.
bool blownOut(ivec2 at) {
  vec4 c = texelFetch(view, at, 0);
  return all(greaterThanEqual(texelFetch(live, at, 0).rgb, vec3(BLOWN_OUT - 0.001)))
    && c.a >= MIN_ALPHA && all(greaterThanEqual(c.rgb * exposure.rgb, vec3(BRIGHT * c.a)));
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  ivec2 size = textureSize(view, 0);
  ivec2 last = size - 1;
  vec3 gain = brighter(at, vec2(size));
  float error = l1(rendered(at, gain), texelFetch(live, at, 0).rgb);
  // Displaced, it can only be less.
  if (shift_px > 0.0 && error > threshold) {
    vec3 ours[9];
    vec3 theirs[9];
    for (int y = 0; y < 3; y++) {
      for (int x = 0; x < 3; x++) {
        ivec2 there = clamp(at + ivec2(x, y) - 1, ivec2(0), last);
        ours[3 * y + x] = rendered(there, gain);
        theirs[3 * y + x] = texelFetch(live, there, 0).rgb;
      }
    }
    error = max(least(ours, theirs[4]), least(theirs, ours[4]));
  }
  bool empty = texelFetch(view, at, 0).a < MIN_ALPHA;
  bool over = error > threshold || (apart && empty);
  bool unseen = empty;
  float hopeless = 0.0;
  if (remembers) {
    vec2 told = texelFetch(memory, at * textureSize(memory, 0) / size, 0).rg;
    unseen = told.r > 0.5;
    hopeless = told.g > 0.5 ? 0.5 : 0.0;
  }
  if (!apart || !over || unseen) hopeless = 0.0;
  else if (blownOut(at)) hopeless = 1.0;
  bool peaked = hopeless == 0.0 && (over || (apart && unseen));
  result = vec4(peaked ? 1.0 : 0.0, unseen ? 1.0 : 0.0, error / 3.0, hopeless);
}
