#version 300 es
// How much of each part of the picture is wrong, and how deep it is: for the memory of where.
precision highp float;
precision highp int;
precision highp usampler2D;

uniform sampler2D result; // of compare.frag.glsl
uniform usampler2D live; // millimetres, top row first, 0 = unknown
uniform ivec2 parts;

out vec4 place; // share; depth in 16-bit millimetres, low and high; 1

const int TAPS = 6;

void main() {
  vec2 first = floor(gl_FragCoord.xy);
  float wrong = 0.0;
  for (int y = 0; y < TAPS; y++) {
    for (int x = 0; x < TAPS; x++) {
      vec2 at = (first + (vec2(x, y) + 0.5) / float(TAPS)) / vec2(parts);
      vec4 r = texture(result, at);
      if (r.r > 0.5 && r.g < 0.5) wrong += 1.0;
    }
  }
  ivec2 size = textureSize(live, 0);
  vec2 middle = gl_FragCoord.xy / vec2(parts);
  ivec2 texel = clamp(ivec2(vec2(middle.x, 1.0 - middle.y) * vec2(size)), ivec2(0), size - 1);
  float mm = float(texelFetch(live, texel, 0).r);
  float high = floor(mm / 256.0);
  place = vec4(wrong / float(TAPS * TAPS), (mm - 256.0 * high) / 255.0, high / 255.0, 1.0);
}
