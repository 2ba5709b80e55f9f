#version 300 es
// What follows from the answers: red never seen, green no view will help. Twin of `Memory.look` and
// `Memory.moved` of src/peaking/memory/, with what is rendered in place of the cells.
precision highp float;

uniform sampler2D answers; // of ask.frag.glsl
uniform sampler2D view; // what is rendered
uniform sampler2D result; // of compare.frag.glsl, for the frame before

out vec4 told;

const float MIN_ALPHA = 0.5;
const int AREA = 4; // to each side
const float SHARE = 0.45;
const float MANY = float((2 * AREA + 1) * (2 * AREA + 1));
const float NEARER = 0.2, CLEARLY = 0.5, FAR = 0.8; // between the levels of the answers

ivec2 last;

vec4 answer(ivec2 at) {
  return texelFetch(answers, clamp(at, ivec2(0), last), 0);
}

bool is_clear(ivec2 at) {
  vec4 a = answer(at);
  return a.g > 0.5 && a.r > CLEARLY;
}

// Clear in all of some square of 3x3 that this is part of.
bool is_more_than_a_speck(ivec2 at) {
  for (int y = -1; y <= 1; y++) {
    for (int x = -1; x <= 1; x++) {
      bool all_of_it = true;
      for (int v = -1; v <= 1 && all_of_it; v++) {
        for (int u = -1; u <= 1 && all_of_it; u++) all_of_it = is_clear(at + ivec2(x + u, y + v));
      }
      if (all_of_it) return true;
    }
  }
  return false;
}

// Peaked and seen, or peaked before it was known that no view will help.
bool is_wrong(ivec2 at) {
  vec4 r = texture(result, (vec2(at) + 0.5) / vec2(last + 1));
  return (r.r > 0.5 && r.g < 0.5) || r.a > 0.25;
}

bool has_moved(ivec2 at) {
  float found = 0.0;
  for (int y = -AREA; y <= AREA; y++) {
    for (int x = -AREA; x <= AREA; x++) {
      ivec2 there = at + ivec2(x, y);
      if (any(lessThan(there, ivec2(0))) || any(greaterThan(there, last))) continue;
      if (answer(there).b > 0.5 && is_wrong(there)) found += 1.0;
    }
  }
  return found > SHARE * MANY;
}

bool is_empty(ivec2 at) {
  vec2 size = vec2(last + 1);
  float least = 1.0;
  for (int y = 0; y < 2; y++) {
    for (int x = 0; x < 2; x++) {
      least = min(least, texture(view, (vec2(at) + 0.25 + 0.5 * vec2(x, y)) / size).a);
    }
  }
  return least < MIN_ALPHA;
}

bool was_never_seen(ivec2 at) {
  vec4 a = answer(at);
  bool empty = is_empty(at);
  if (a.g < 0.5) return empty;
  return empty ? a.r > NEARER : a.r > FAR || (a.r > CLEARLY && is_more_than_a_speck(at));
}

// What views saw ends a little later than what can be shown of it.
bool is_at_the_rim(ivec2 at) {
  if (!is_empty(at)) return false;
  for (int y = -1; y <= 1; y++) {
    for (int x = -1; x <= 1; x++) {
      if (was_never_seen(clamp(at + ivec2(x, y), ivec2(0), last))) return true;
    }
  }
  return false;
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  last = textureSize(answers, 0) - 1;
  bool unseen = was_never_seen(at) || is_at_the_rim(at);
  bool moved = !unseen && is_wrong(at) && has_moved(at);
  told = vec4(unseen ? 1.0 : 0.0, moved ? 1.0 : 0.0, 0.0, 1.0);
}
