#version 300 es
// sum(w a d) / sum(w a) in tenths of a millimetre, 24 bits, as in src/peaking/rendering/blending.py.
precision highp float;

uniform sampler2D sums;

in vec2 uv;
out vec4 colour;

void main() {
  vec4 sum = texture(sums, uv);
  float depth = sum.a > 0.0 ? min(sum.r / sum.a, 1000.0) : 0.0;
  float metres = floor(depth);
  float rest = floor((depth - metres) * 10000.0 + 0.5);
  float tenths = metres * 10000.0 + rest; // below 2^24, so exact
  float high = floor(tenths / 65536.0);
  float middle = floor((tenths - high * 65536.0) / 256.0);
  float low = tenths - high * 65536.0 - middle * 256.0;
  colour = vec4(low, middle, high, 255.0) / 255.0;
}
