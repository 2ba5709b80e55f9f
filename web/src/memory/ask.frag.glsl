#version 300 es
// Whether any view saw the surface that live depth measures, and whether views looked through where
// it is; twin of `behind` and `looked_through` of src/peaking/memory/_numpy.py.
precision highp float;
precision highp int;
precision highp sampler2DArray;
precision highp usampler2D;

const int MAX_ASKED = 16; // of depth_maps.ts

uniform usampler2D live; // millimetres, top row first, 0 = unknown
uniform sampler2DArray maps; // of store_depth.frag.glsl, bottom row first
uniform int count;
uniform int layers[MAX_ASKED];
uniform vec4 rows[3 * MAX_ASKED]; // [R | t], from the camera here to each view's
uniform vec4 inner[MAX_ASKED]; // fx, fy, cx, cy of each view; x and y go from 0 to 1
uniform vec4 inner_here;

// How far the surface is hidden from the view it is least in: 0 not, 85, 170, 255 as NEARER, CLEARLY
// and FAR say; whether that can be told; whether at least two views looked through; 1.
out vec4 answer;

in vec2 uv; // from the bottom left corner

const float NEAR_M = 0.05;
const float NEARER = 0.03;
const float CLEARLY_NEARER = 0.05;
const float FAR_NEARER = 0.12;
const float STEP = 1.10;
const float THROUGH = 0.06;
const int MIN_THROUGH = 2;
const float NOWHERE = 1e6;

float seen_m(ivec3 at) {
  vec2 bytes = floor(255.0 * texelFetch(maps, at, 0).rg + 0.5);
  return 0.001 * (bytes.r + 256.0 * bytes.g);
}

// Live depth whose neighbours are about as deep; edges are rarely exact.
bool is_smooth(ivec2 at, ivec2 last) {
  float nearest = NOWHERE;
  float farthest = 0.0;
  for (int y = -1; y <= 1; y++) {
    for (int x = -1; x <= 1; x++) {
      float z = float(texelFetch(live, clamp(at + ivec2(x, y), ivec2(0), last), 0).r);
      farthest = max(farthest, z);
      if (z > 0.0) nearest = min(nearest, z);
    }
  }
  return farthest < STEP * nearest;
}

void main() {
  ivec2 size = textureSize(live, 0);
  vec2 here = vec2(uv.x, 1.0 - uv.y);
  ivec2 at = clamp(ivec2(here * vec2(size)), ivec2(0), size - 1);
  float z = 0.001 * float(texelFetch(live, at, 0).r);
  answer = vec4(0.0, 0.0, 0.0, 1.0);
  if (z <= 0.0) return;
  vec4 p = vec4((here - inner_here.zw) / inner_here.xy * z, z, 1.0);
  ivec2 map_size = textureSize(maps, 0).xy;
  float least = NOWHERE;
  int through = 0;
  for (int k = 0; k < MAX_ASKED; k++) {
    if (k >= count || (least <= 0.0 && through >= MIN_THROUGH)) break;
    float z_there = dot(rows[3 * k + 2], p);
    if (z_there <= NEAR_M) continue;
    vec2 there = vec2(dot(rows[3 * k], p), dot(rows[3 * k + 1], p)) / z_there;
    there = there * inner[k].xy + inner[k].zw;
    if (any(lessThan(there, vec2(0.0))) || any(greaterThanEqual(there, vec2(1.0)))) continue;
    ivec2 texel = ivec2(vec2(there.x, 1.0 - there.y) * vec2(map_size));
    texel = clamp(texel, ivec2(0), map_size - 1);
    float seen = seen_m(ivec3(texel, layers[k]));
    if (seen <= 0.0) continue;
    least = min(least, z_there / seen - 1.0);
    if (z_there >= (1.0 - THROUGH) * seen) continue;
    float nearest = NOWHERE;
    for (int y = -1; y <= 1; y++) {
      for (int x = -1; x <= 1; x++) {
        ivec2 beside = clamp(texel + ivec2(x, y), ivec2(0), map_size - 1);
        float there_m = seen_m(ivec3(beside, layers[k]));
        if (there_m > 0.0) nearest = min(nearest, there_m);
      }
    }
    if (z_there < (1.0 - THROUGH) * nearest) through++;
  }
  float hidden = least > FAR_NEARER ? 3.0 : least > CLEARLY_NEARER ? 2.0 : least > NEARER ? 1.0 : 0.0;
  answer = vec4(hidden / 3.0, is_smooth(at, size - 1) ? 1.0 : 0.0, through >= MIN_THROUGH ? 1.0 : 0.0, 1.0);
}
